extends RefCounted
## A ZMTP connection over TCP that comes back: never blocks on the peer, a new try after a pause that grows.
## Belongs to the thread that polls it. What it is for is in the classes that extend it.

const Zmtp := preload("zmtp.gd")

const FIRST_PAUSE_USEC := 100_000
const LONGEST_PAUSE_USEC := 2_000_000
## A peer that begins something and does not go on for so long is given up.
const STALL_USEC := 5_000_000
## Bytes taken at a time, so that one link does not starve the others.
const _TAKE_BYTES := 256 * 1024

## How often the connection stood.
var connections := 0
## Why it ended last, for a person.
var last_fault := ""
## How often the peer broke the rules, and how often it stalled.
var violations := 0
var stalls := 0

var _zmtp: Zmtp
var _host: String
var _port: int
var _socket_type: String
var _tcp: StreamPeerTCP
var _next_try_usec := 0
var _pause_usec := FIRST_PAUSE_USEC
var _progress_usec := 0
var _opened_usec := 0
var _was_ready := false


func _init(host: String, port: int, socket_type: String) -> void:
	_host = host
	_port = port
	_socket_type = socket_type


func is_ready() -> bool:
	return _was_ready


## Does what can be done without waiting. Says whether anything came.
func poll(now_usec: int) -> bool:
	if _tcp == null:
		if now_usec < _next_try_usec:
			return false
		_open(now_usec)
	_tcp.poll()
	match _tcp.get_status():
		StreamPeerTCP.STATUS_CONNECTED:
			return _exchange(now_usec)
		StreamPeerTCP.STATUS_CONNECTING:
			if now_usec - _progress_usec > STALL_USEC:
				_close(now_usec, "nobody answers at %s:%d" % [_host, _port])
		_:
			_close(now_usec, "the connection to %s:%d ended" % [_host, _port] if _was_ready
					else "nobody listens at %s:%d: is the service running?" % [_host, _port])
	return false


func close() -> void:
	if _tcp != null:
		_tcp.disconnect_from_host()


## Bytes that wait for the peer to take them.
func backlog() -> int:
	return _zmtp.outgoing.size() if _zmtp != null else 0


## The connection is made; what is sent here goes out with the greeting.
func _begun() -> void:
	pass


func _ready_to_use(_now_usec: int) -> void:
	pass


func _received(_frames: Array[PackedByteArray], _now_usec: int) -> void:
	pass


func _ended() -> void:
	pass


## End this connection and try again later.
func _close(now_usec: int, why: String) -> void:
	last_fault = why
	_tcp.disconnect_from_host()
	_tcp = null
	_zmtp = null
	_was_ready = false
	# A peer that only ever greets and hangs up is not asked more and more often.
	if now_usec - _opened_usec > LONGEST_PAUSE_USEC:
		_pause_usec = FIRST_PAUSE_USEC
	_next_try_usec = now_usec + _pause_usec
	_pause_usec = mini(2 * _pause_usec, LONGEST_PAUSE_USEC)
	_ended()


func _open(now_usec: int) -> void:
	# A refused connection is final for a peer object.
	_tcp = StreamPeerTCP.new()
	_zmtp = Zmtp.new(_socket_type)
	_progress_usec = now_usec
	_opened_usec = now_usec
	if _tcp.connect_to_host(_host, _port) == OK:
		_tcp.set_no_delay(true)


func _exchange(now_usec: int) -> bool:
	var there := mini(_tcp.get_available_bytes(), _TAKE_BYTES)
	if there > 0:
		_progress_usec = now_usec
		_zmtp.receive(_tcp.get_partial_data(there)[1])
		if _zmtp.is_ready and not _was_ready:
			_was_ready = true
			connections += 1
			_ready_to_use(now_usec)
		_hand_over(now_usec)
	if _tcp == null:
		return true
	if not _zmtp.fault.is_empty():
		violations += 1
		_close(now_usec, _zmtp.fault)
	elif _zmtp.is_waiting_for_rest() and now_usec - _progress_usec > STALL_USEC:
		stalls += 1
		_close(now_usec, "the service at %s:%d stalled" % [_host, _port])
	elif not _zmtp.outgoing.is_empty():
		_flush()
	return there > 0


func _hand_over(now_usec: int) -> void:
	var messages := _zmtp.incoming
	_zmtp.incoming = []
	for frames: Array[PackedByteArray] in messages:
		if _tcp == null:
			return
		_received(frames, now_usec)


func _flush() -> void:
	var sent: Array = _tcp.put_partial_data(_zmtp.outgoing)
	if sent[0] == OK and sent[1] > 0:
		_zmtp.outgoing = _zmtp.outgoing.slice(sent[1])
