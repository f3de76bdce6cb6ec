extends "link.gd"
## Asks the control socket who serves, and bursts of `time` (SPEC, sections 3 and 7). A REQ without its answer is stuck,
## so the connection is given up then.

const Msgpack := preload("msgpack.gd")
const TimeSync := preload("time_sync.gd")
const Bodies := preload("bodies.gd")
const Checks := preload("checks.gd")

const ANSWER_USEC := 500_000

var time := TimeSync.new()
## Who serves the bus, as `hello` said; empty before.
var session := ""
var bad_answers := 0

var _msgpack := Msgpack.new()
var _asked := ""
var _asked_ns := 0
var _next_usec := 0
var _exchanges: Array[PackedInt64Array] = []


func _init(host: String, port: int) -> void:
	super(host, port, "REQ")


## Whether an answer is due any moment, and its arrival should be noticed at once.
func is_waiting() -> bool:
	return not _asked.is_empty()


func poll(now_usec: int) -> bool:
	var came := super(now_usec)
	if not is_ready():
		return came
	if is_waiting():
		if now_usec * 1000 - _asked_ns > ANSWER_USEC * 1000:
			stalls += 1
			_close(now_usec, "no answer to '%s' from %s:%d" % [_asked, _host, _port])
	elif now_usec >= _next_usec:
		_ask("time")
	return came


## Another session id was seen: the offset to the old service's clock is worth nothing.
func on_session(id: String) -> void:
	if id == session:
		return
	if not session.is_empty():
		time.forget()
		_exchanges.clear()
		_next_usec = 0
	session = id


func _ready_to_use(_now_usec: int) -> void:
	_ask("hello")


func _ended() -> void:
	_asked = ""
	_exchanges.clear()


func _ask(what: String) -> void:
	_asked = what
	var request := Msgpack.pack({"cmd": what, "args": {}})
	_asked_ns = Time.get_ticks_usec() * 1000
	_zmtp.send([PackedByteArray(), request])
	_flush()


func _received(frames: Array[PackedByteArray], now_usec: int) -> void:
	var arrival := Time.get_ticks_usec() * 1000
	var asked := _asked
	_asked = ""
	var result: Variant = _result(frames, asked)
	if result == null:
		bad_answers += 1
		_close(now_usec, "the service answers '%s' with something else" % asked)
		return
	if asked == "hello":
		on_session(result["session"])
		_next_usec = now_usec
		return
	_exchanges.append(PackedInt64Array([_asked_ns, result["t"], arrival]))
	if _exchanges.size() >= TimeSync.BURST:
		time.on_burst(_exchanges)
		_exchanges.clear()
		@warning_ignore("integer_division")
		_next_usec = now_usec + TimeSync.PERIOD / 1000


## The result of an answer that is one, or null.
func _result(frames: Array[PackedByteArray], asked: String) -> Variant:
	if asked.is_empty() or frames.size() != 2 or not frames[0].is_empty():
		return null
	var answer: Variant = _msgpack.unpack(frames[1])
	if not answer is Dictionary or not answer.get("ok") is bool or not answer["ok"]:
		return null
	var due: Checks.Check = Bodies.of_system["session"].body if asked == "hello" else Bodies.time
	var reading := Checks.Reading.new()
	var result: Variant = due.read(answer.get("result"), reading)
	return result if reading.fault.is_empty() else null
