extends SceneTree
## Feeds bursts (JSON: a list of bursts of [sent, bus, received] in ns as strings) and says offset and uncertainty after
## each, as strings.

const TimeSync := preload("res://addons/foottrack/wire/time_sync.gd")


func _init() -> void:
	var time := TimeSync.new()
	var said := []
	for burst: Array in JSON.parse_string(OS.get_cmdline_user_args()[0]):
		var exchanges: Array[PackedInt64Array] = []
		var last := 0
		for exchange: Array in burst:
			exchanges.append(PackedInt64Array([int(exchange[0]), int(exchange[1]), int(exchange[2])]))
			last = int(exchange[2])
		time.on_burst(exchanges)
		said.append([str(time.offset) if time.is_known else null, str(time.uncertainty(last))])
	print("LINE " + JSON.stringify(said))
	quit()
