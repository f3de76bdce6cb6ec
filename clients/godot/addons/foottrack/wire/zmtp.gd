extends RefCounted
## One end of a ZMTP 3.0 connection, mechanism NULL (SPEC, section 1), without its socket: bytes in, messages and bytes
## out. Of ZMTP 3.1 it understands PING, SUBSCRIBE and CANCEL.

const MAX_FRAME_BYTES := 4 * 1024 * 1024
## Of a longer message the rest is thrown away; two is what the wire has, so it is refused in any case.
const MAX_KEPT_FRAMES := 3
const SUBSCRIBE := 1
const CANCEL := 0

const _GREETING_BYTES := 64
const _MORE := 1
const _LONG := 2
const _COMMAND := 4
const _PEERS := {"SUB": ["PUB", "XPUB"], "XPUB": ["SUB", "XSUB"], "REQ": ["REP", "ROUTER"],
		"DEALER": ["REP", "ROUTER"]}

## Both sides have said READY.
var is_ready := false
## What the peer did that ends the connection, for a person; empty as long as it may go on.
var fault := ""
## Bytes for the peer; whoever sends them takes them away.
var outgoing := PackedByteArray()
## Messages that came, each an Array[PackedByteArray]; whoever reads them takes them away.
var incoming: Array[Array] = []

var _socket_type: String
var _pending := PackedByteArray()
var _greeted := false
var _frames: Array[PackedByteArray] = []
var _in_message := false


func _init(socket_type: String) -> void:
	_socket_type = socket_type
	var mechanism := "NULL".to_ascii_buffer()
	outgoing.resize(_GREETING_BYTES)
	outgoing[0] = 0xff
	outgoing[9] = 0x7f
	outgoing[10] = 3
	for i in mechanism.size():
		outgoing[12 + i] = mechanism[i]


## Whether the peer owes the rest of something that it began.
func is_waiting_for_rest() -> bool:
	return not is_ready or _in_message or not _pending.is_empty()


## Takes what the peer sent.
func receive(bytes: PackedByteArray) -> void:
	if not fault.is_empty():
		return
	_pending.append_array(bytes)
	if not _greeted and not _greet():
		return
	var at := 0
	while fault.is_empty():
		var next := _frame(at)
		if next < 0:
			break
		at = next
	if at > 0:
		_pending = _pending.slice(at)


## One message.
func send(frames: Array[PackedByteArray]) -> void:
	for i in frames.size():
		_put(_MORE if i < frames.size() - 1 else 0, frames[i])


## Subscribes to a prefix, as a subscriber does in ZMTP 3.0; `kind` CANCEL ends that.
func subscribe(prefix: PackedByteArray, kind := SUBSCRIBE) -> void:
	_put(0, PackedByteArray([kind]) + prefix)


func _greet() -> bool:
	if (not _pending.is_empty() and _pending[0] != 0xff) or (_pending.size() > 9 and _pending[9] != 0x7f):
		fault = "what answers there does not speak ZMTP: is this the right port?"
	elif _pending.size() > 10 and _pending[10] < 3:
		fault = "the peer speaks ZMTP %d, at least 3 is needed" % _pending[10]
	elif _pending.size() >= _GREETING_BYTES:
		var mechanism := _ascii(_pending.slice(12, 32))
		if mechanism == "NULL":
			_greeted = true
			_pending = _pending.slice(_GREETING_BYTES)
			_put_command("READY", _property("Socket-Type", _socket_type))
		else:
			fault = "the service wants %s, this client has none: connect to a relay on this host" % mechanism
	return _greeted


## Reads the frame that begins at `at` and says where the next one does, or -1: not all of it is there.
func _frame(at: int) -> int:
	var there := _pending.size() - at
	if there < 2:
		return -1
	var flags := _pending[at]
	if flags > 7 or (flags & _COMMAND and flags & _MORE):
		fault = "the peer sent a frame with flags that there are not"
		return -1
	var header := 2
	var length := _pending[at + 1]
	if flags & _LONG:
		header = 9
		if there < header:
			return -1
		length = 0
		for i in 8:
			length = (length << 8) | _pending[at + 1 + i]
	if length < 0 or length > MAX_FRAME_BYTES:
		fault = "the peer announced a frame of more than %d bytes" % MAX_FRAME_BYTES
		return -1
	if there < header + length:
		return -1
	var end := at + header + length
	var content := _pending.slice(at + header, end)
	if flags & _COMMAND:
		_command(content)
	elif not is_ready:
		fault = "the peer sent a message before it was ready"
	else:
		_in_message = flags & _MORE != 0
		if _frames.size() < MAX_KEPT_FRAMES:
			_frames.append(content)
		if not _in_message:
			incoming.append(_frames)
			_frames = []
	return end


func _command(content: PackedByteArray) -> void:
	var length := content[0] if not content.is_empty() else 0
	var name := _ascii(content.slice(1, 1 + length))
	var body := content.slice(1 + length)
	match name:
		"READY":
			_peer_ready(body)
		"PING":
			if body.size() >= 2:
				_put_command("PONG", body.slice(2))
		"SUBSCRIBE":
			incoming.append([PackedByteArray([SUBSCRIBE]) + body] as Array[PackedByteArray])
		"CANCEL":
			incoming.append([PackedByteArray([CANCEL]) + body] as Array[PackedByteArray])
		"ERROR":
			fault = "the peer refuses: %s" % _ascii(body.slice(1))


func _peer_ready(properties: PackedByteArray) -> void:
	var at := 0
	while at < properties.size():
		var name_end := at + 1 + properties[at]
		if name_end + 4 > properties.size():
			fault = "the peer sent a malformed READY"
			return
		var length := 0
		for i in 4:
			length = (length << 8) | properties[name_end + i]
		var end := name_end + 4 + length
		if end > properties.size():
			fault = "the peer sent a malformed READY"
			return
		var value := _ascii(properties.slice(name_end + 4, end))
		if _ascii(properties.slice(at + 1, name_end)).to_lower() == "socket-type" and not value in _PEERS[_socket_type]:
			fault = "a %s socket answers to our %s: is this the right port?" % [value, _socket_type]
			return
		at = end
	is_ready = true


func _put_command(name: String, body: PackedByteArray) -> void:
	_put(_COMMAND, PackedByteArray([name.length()]) + name.to_ascii_buffer() + body)


func _put(flags: int, content: PackedByteArray) -> void:
	var length := content.size()
	if length < 256:
		outgoing.append_array(PackedByteArray([flags, length]))
	else:
		outgoing.append(flags | _LONG)
		for i in 8:
			outgoing.append((length >> (56 - 8 * i)) & 0xff)
	outgoing.append_array(content)


static func _property(name: String, value: String) -> PackedByteArray:
	var size := PackedByteArray([0, 0, 0, value.length()])
	return PackedByteArray([name.length()]) + name.to_ascii_buffer() + size + value.to_ascii_buffer()


## What can be read of bytes that should be ASCII.
static func _ascii(bytes: PackedByteArray) -> String:
	var made := ""
	for byte in bytes:
		if byte >= 0x20 and byte < 0x7f:
			made += char(byte)
	return made
