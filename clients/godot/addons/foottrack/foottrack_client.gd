@icon("icon.svg")
class_name FoottrackClient
extends Node
## The way to a foottrack service. One per scene is enough: FoottrackBody and FoottrackHeadPublisher share it.
##
## It connects when it enters the tree, and again whenever the service was restarted. All signals come in `_process`, on
## the main thread, before the bodies that use them.

const Message := preload("wire/message.gd")
const BusThread := preload("wire/bus_thread.gd")
const Msgpack := preload("wire/msgpack.gd")
const RequestLink := preload("wire/request_link.gd")

## The bus was found (again), and nothing is missed from now on.
signal connected
## The bus was lost; `why` is for a person.
signal disconnected(why: String)
## Something keeps a connection from standing: nobody listens, something else does, it stalls. Told when it changes.
signal troubled(why: String)
## The newest of a stream of which only the newest counts: `pose/body`, `pose/ik`, `gait/state`.
signal pose_received(message: Message)
## Each message of the other streams, in order: `gait/event`, `calibration`, `sys/...`.
signal event_received(message: Message)
## Something came that was no message; at most once a second. With reason "version" the addon and the service do not
## fit together.
signal refused(topic: String, reason: String, detail: String)
## What `request` waits for.
signal answered(id: int, answer: Dictionary)

## Where the service is. Changes count when the client enters the tree.
@export var host := "127.0.0.1"
@export_range(1, 65535) var ingress_port := 7701
@export_range(1, 65535) var egress_port := 7702
@export_range(1, 65535) var control_port := 7703
## Whose feet: the first part of the topics.
@export var user := "user"
## Beginnings of this user's streams that are wanted.
@export var streams: PackedStringArray = ["pose/", "gait/", "calibration"]
## What this client calls itself in what it publishes.
@export var source := "godot"

var _thread: BusThread
var _newest := {}
var _sid := ""
var _was_connected := false
var _trouble := ""
var _requests := 0
var _unanswered := {}
var _last_refusal_usec := -1_000_000


func _init() -> void:
	process_priority = -100
	# A paused game still has a person in it.
	process_mode = PROCESS_MODE_ALWAYS


func _enter_tree() -> void:
	_sid = Crypto.new().generate_random_bytes(6).hex_encode()
	_newest = {}
	var prefixes := PackedStringArray(["sys/session"])
	for stream in streams:
		prefixes.append(user + "/" + stream)
	_thread = BusThread.new()
	_thread.start(host, ingress_port, egress_port, control_port, prefixes)


func _exit_tree() -> void:
	_thread.stop()
	_thread = null
	_was_connected = false
	_trouble = ""
	for id: int in _unanswered.keys():
		_answer(id, RequestLink.failure(RequestLink.TIMEOUT, "the client left the scene"))


func _process(_delta: float) -> void:
	var batch := _thread.take()
	_notice_connection()
	_notice_trouble()
	for message in batch.every:
		_newest[message.topic] = message
		event_received.emit(message)
	for topic: String in batch.newest:
		_newest[topic] = batch.newest[topic]
		pose_received.emit(batch.newest[topic])
	for id: int in batch.answers:
		_answer(id, batch.answers[id])
	if not batch.refusal.is_empty():
		_tell(batch.refusal)


## The newest message of one of the user's streams, such as "pose/body", or null.
func newest(stream: String) -> Message:
	return _newest.get(user + "/" + stream)


## The bus clock now, ns. Only an estimate as long as the client is not `is_synchronised`.
func bus_time() -> int:
	return Time.get_ticks_usec() * 1000 + (_thread.offset() if _thread != null else 0)


## Seconds from when a message was true until now. Before the clocks are synchronised: since it came.
func age(message: Message) -> float:
	if not is_synchronised():
		return (Time.get_ticks_usec() - message.arrival_usec) * 1e-6
	return (bus_time() - message.t) * 1e-9


## Whether the bus clock is known, so that what is published is valid.
func is_synchronised() -> bool:
	return _thread != null and _thread.is_synchronised()


## Whether the bus is there.
func is_connected_to_bus() -> bool:
	return _was_connected


## Publishes one of the user's streams, true at `t_usec` of `Time.get_ticks_usec()`. What cannot be sent now is counted
## and leaves a gap in `seq`; in no scene it is nothing.
func publish(stream: String, t_usec: int, data: Dictionary, valid := true) -> void:
	if _thread == null:
		return
	var message := Message.new()
	message.user = user
	message.stream = stream
	message.src = source
	message.sid = _sid
	message.t = t_usec * 1000
	message.valid = valid
	message.data = data
	_thread.publish(message)


## Asks the service (SPEC, section 7), as in `await client.request("calibrate/floor", {}, 60.0)`. The answer is
## {ok: true, result} or {ok: false, error: {code, message}}; the code is "timeout" where none came.
func request(cmd: String, args := {}, timeout_s := 2.0) -> Dictionary:
	_requests += 1
	var asked := RequestLink.Request.new()
	asked.id = _requests
	asked.cmd = cmd
	asked.payload = Msgpack.pack({"cmd": cmd, "args": args})
	asked.deadline_usec = Time.get_ticks_usec() + int(timeout_s * 1e6)
	if _thread == null:
		return RequestLink.failure(RequestLink.TIMEOUT, "the client is in no scene")
	_unanswered[asked.id] = true
	_thread.ask(asked)
	while true:
		var told: Array = await answered
		if told[0] == asked.id:
			return told[1]
	return {}


## Counters: connections, messages, gaps and refusals by topic, what was sent and not; empty in no scene.
func statistics() -> Dictionary:
	return _thread.state() if _thread != null else {}


func _answer(id: int, answer: Dictionary) -> void:
	_unanswered.erase(id)
	answered.emit(id, answer)


func _notice_connection() -> void:
	var is_now := _thread.is_live()
	if is_now == _was_connected:
		return
	_was_connected = is_now
	if is_now:
		connected.emit()
	else:
		disconnected.emit(_thread.fault())


func _notice_trouble() -> void:
	var trouble := _thread.fault()
	if trouble == _trouble:
		return
	_trouble = trouble
	if not trouble.is_empty():
		push_warning("foottrack: " + trouble)
		troubled.emit(trouble)


func _tell(refusal: Array) -> void:
	var now := Time.get_ticks_usec()
	if now - _last_refusal_usec < 1_000_000:
		return
	_last_refusal_usec = now
	push_warning("foottrack refused a message on '%s': %s (%s)" % refusal)
	refused.emit(refusal[0], refusal[1], refusal[2])
