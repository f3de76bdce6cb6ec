extends SceneTree
## The engine's side of bench_godot.py and long_run.py: receives at 60 fps and says how late each message was, in the receiving thread and in
## `_process`, and how long the longest frame took. The one argument is JSON: {ingress, egress, control}.

const Client := preload("res://addons/foottrack/foottrack_client.gd")
const FINAL := 424242
const SAMPLES := 500_000

var _client: Client
var _in_thread := PackedFloat64Array()
var _in_process := PackedFloat64Array()
var _samples := 0
var _events := 0
var _last_usec := 0
var _longest_frame_ms := 0.0
var _frames := 0


func _initialize() -> void:
	Engine.max_fps = 60
	# Taken now, so that memory that grows is the client's.
	_in_thread.resize(SAMPLES)
	_in_process.resize(SAMPLES)
	var settings: Dictionary = JSON.parse_string(OS.get_cmdline_user_args()[0])
	_client = Client.new()
	_client.ingress_port = settings["ingress"]
	_client.egress_port = settings["egress"]
	_client.control_port = settings["control"]
	_client.connected.connect(func() -> void: _say({"kind": "connected"}))
	_client.event_received.connect(_on_event)
	_client.pose_received.connect(_sample)
	root.add_child(_client)


func _process(_delta: float) -> bool:
	var now := Time.get_ticks_usec()
	if _last_usec > 0:
		_longest_frame_ms = maxf(_longest_frame_ms, (now - _last_usec) * 1e-3)
	_last_usec = now
	_frames += 1
	if _frames % 60 == 0:
		_say({"kind": "frames", "synchronised": _client.is_synchronised(), "statistics": _client.statistics()})
	return false


func _sample(message: RefCounted) -> void:
	if not _client.is_synchronised() or _samples >= SAMPLES:
		return
	var offset_usec := (_client.bus_time() - Time.get_ticks_usec() * 1000) / 1000.0
	_in_process[_samples] = (_client.bus_time() - message.t_pub) * 1e-6
	_in_thread[_samples] = (message.arrival_usec + offset_usec) * 1e-3 - message.t_pub * 1e-6
	_samples += 1


func _on_event(message: RefCounted) -> void:
	if message.stream != "gait/event":
		return
	if message.data["event"] == "first_step":
		_say({"kind": "reached", "step": message.data["step"]})
		return
	if message.data["step"] != FINAL:
		_events += 1
		_sample(message)
		return
	_say({
		"kind": "final",
		"events": _events,
		"in_thread_ms": Array(_in_thread.slice(0, _samples)),
		"in_main_ms": Array(_in_process.slice(0, _samples)),
		"longest_frame_ms": _longest_frame_ms,
		"statistics": _client.statistics(),
	})
	quit()


func _say(what: Dictionary) -> void:
	print("LINE " + JSON.stringify(what))
