extends SceneTree
## A client as a game has it, which tells the test what it sees, a line of JSON at a time. The one argument is JSON:
## {host?, ingress, egress, control, streams?, head?}. The gait event "stop" with the step FINAL ends it.

const Client := preload("res://addons/foottrack/foottrack_client.gd")
const HeadPublisher := preload("res://addons/foottrack/foottrack_head_publisher.gd")
const FINAL := 424242
const FRAMES_PER_LINE := 30

var _client: Client
var _frames := 0
var _steps: Array[int] = []
var _poses: Array[int] = []


func _initialize() -> void:
	var settings: Dictionary = JSON.parse_string(OS.get_cmdline_user_args()[0])
	_client = Client.new()
	_client.host = settings.get("host", "127.0.0.1")
	_client.ingress_port = settings["ingress"]
	_client.egress_port = settings["egress"]
	_client.control_port = settings["control"]
	if settings.has("streams"):
		_client.streams = settings["streams"]
	_client.connected.connect(func() -> void: _say({"kind": "connected"}))
	_client.disconnected.connect(func(why: String) -> void: _say({"kind": "disconnected", "why": why}))
	_client.troubled.connect(func(why: String) -> void: _say({"kind": "troubled", "why": why}))
	_client.refused.connect(_on_refused)
	_client.event_received.connect(_on_event)
	_client.pose_received.connect(func(message: RefCounted) -> void: _poses.append(message.seq))
	root.add_child(_client)
	if settings.get("head", false):
		var camera := Camera3D.new()
		camera.position = Vector3(0.25, 1.5, -0.5)
		camera.rotation = Vector3(0.0, PI / 2.0, 0.0)
		root.add_child(camera)
		var publisher := HeadPublisher.new()
		publisher.client = _client
		publisher.camera = camera
		root.add_child(publisher)


func _process(_delta: float) -> bool:
	_frames += 1
	if _frames % FRAMES_PER_LINE == 0:
		_say({"kind": "frames", "statistics": _client.statistics(), "synchronised": _client.is_synchronised()})
	return false


func _on_event(message: RefCounted) -> void:
	if message.stream != "gait/event":
		return
	if message.data["event"] == "stop" and message.data["step"] == FINAL:
		_say({"kind": "final", "steps": _steps, "poses": _poses, "statistics": _client.statistics()})
		quit()
	elif message.data["event"] == "first_step":
		# The game stands still until the thread has seen so many.
		_say({"kind": "standing"})
		while _client.statistics()["topics"][message.topic]["messages"] < message.data["step"]:
			OS.delay_msec(10)
	else:
		_steps.append(message.data["step"])


func _on_refused(topic: String, reason: String, detail: String) -> void:
	_say({"kind": "refused", "topic": topic, "reason": reason, "detail": detail})


func _say(what: Dictionary) -> void:
	print("LINE " + JSON.stringify(what))
