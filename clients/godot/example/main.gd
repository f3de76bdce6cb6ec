extends Node3D
## A box person who does what the service says. Start `foottrack demo` beside it.
##
## The demo simulates a headset as well, so there is no FoottrackHeadPublisher here: one head per user.

const Message := preload("res://addons/foottrack/wire/message.gd")

var _events := 0


func _ready() -> void:
	$FoottrackClient.connected.connect(func() -> void: print("foottrack: connected"))
	$FoottrackClient.disconnected.connect(func(why: String) -> void: print("foottrack: %s" % why))
	$FoottrackClient.event_received.connect(_on_event)


func _process(_delta: float) -> void:
	var message: Message = $FoottrackClient.newest("pose/body")
	if message == null:
		return
	var lines := ["%.0f ms old, %d gait events" % [$FoottrackClient.age(message) * 1e3, _events]]
	for side in ["left", "right"]:
		var foot: Variant = message.data[side]
		if foot != null:
			var height: float = foot["ankle"]["p"][1]
			var where := "on the floor" if foot["contact"] else "in the air"
			lines.append("%s: %s, ankle at %.3f m, known by %s" % [side, where, height, foot["stage"]])
	$Text.text = "\n".join(lines)


func _on_event(message: Message) -> void:
	if message.stream == "gait/event":
		_events += 1
