extends "link.gd"
## Asks the control socket what a game wants to know, or to have done (SPEC, section 7). A DEALER, so that a calibration
## that takes a minute holds up nothing; apart from the connection that keeps the time. It is made when it is needed.

const Msgpack := preload("msgpack.gd")

const TIMEOUT := "timeout"
const BAD_ANSWER := "bad_answer"


class Request:
	extends RefCounted
	var id := 0
	var cmd := ""
	var payload := PackedByteArray()
	var deadline_usec := 0
	var is_sent := false


## What became of requests: {ok: true, result} or {ok: false, error: {code, message}} by id; whoever reads it takes it away.
var answers := {}

var _msgpack := Msgpack.new()
var _waiting := {}


func _init(host: String, port: int) -> void:
	super(host, port, "DEALER")


static func failure(code: String, message: String) -> Dictionary:
	return {"ok": false, "error": {"code": code, "message": message}}


func ask(request: Request) -> void:
	_waiting[request.id] = request


## Whether an answer is due, and its arrival should be noticed at once.
func is_waiting() -> bool:
	return not _waiting.is_empty()


func poll(now_usec: int) -> bool:
	if _tcp == null and _waiting.is_empty():
		return false
	var came := super(now_usec)
	for request: Request in _waiting.values():
		if now_usec > request.deadline_usec:
			_finish(request.id, failure(TIMEOUT, "no answer to '%s' from %s:%d in time: is the service running?"
					% [request.cmd, _host, _port]))
		elif is_ready() and not request.is_sent:
			request.is_sent = true
			_zmtp.send([str(request.id).to_ascii_buffer(), PackedByteArray(), request.payload])
			_flush()
	return came


func _ended() -> void:
	for request: Request in _waiting.values():
		if request.is_sent:
			_finish(request.id, failure(TIMEOUT, "the service went away before it answered '%s'" % request.cmd))


func _received(frames: Array[PackedByteArray], _now_usec: int) -> void:
	var id := frames[0].get_string_from_ascii().to_int() if frames.size() == 3 and frames[1].is_empty() else 0
	# The answer to a request that was given up is nobody's.
	if _waiting.has(id):
		_finish(id, _answer(frames[2], _waiting[id].cmd))


func _answer(payload: PackedByteArray, cmd: String) -> Dictionary:
	var said: Variant = _msgpack.unpack(payload)
	if said is Dictionary and _is_sound(said):
		if said.get("ok") is bool and said["ok"]:
			return {"ok": true, "result": said.get("result")}
		var error: Variant = said.get("error")
		if error is Dictionary and error.get("code") is String and error.get("message") is String:
			return failure(error["code"], error["message"])
	return failure(BAD_ANSWER, "the answer to '%s' is neither a result nor an error" % cmd)


func _finish(id: int, answer: Dictionary) -> void:
	_waiting.erase(id)
	answers[id] = answer


## Whether no number in it is NaN or infinite.
static func _is_sound(value: Variant) -> bool:
	if value is Dictionary:
		return value.values().all(_is_sound)
	if value is Array:
		return value.all(_is_sound)
	return not value is float or is_finite(value)
