extends RefCounted
## Two frames to a message and back (SPEC, section 2). Any bytes give a message or a fault with its reason.

const Msgpack := preload("msgpack.gd")
const Checks := preload("checks.gd")
const Bodies := preload("bodies.gd")
const Message := preload("message.gd")

const PROTOCOL_MAJOR := 1
const MAX_PAYLOAD_BYTES := 256 * 1024
const MAX_TOPIC_BYTES := 128
const _MAX_KNOWN_TOPICS := 1024

## Of the last `decode` that gave null: the reason that is counted, more for a person, and the topic when it is one.
var fault := ""
var detail := ""
var fault_topic := ""
var _msgpack := Msgpack.new()
var _user := RegEx.create_from_string("\\A[a-z0-9][a-z0-9-]{0,31}\\z")
var _topics := {}


class Topic:
	extends RefCounted
	var name: String
	var user: String
	var stream: String
	var entry: Bodies.Stream


## The message in two frames, or null.
func decode(frames: Array[PackedByteArray]) -> Message:
	fault_topic = ""
	if frames.size() != 2:
		return _refuse("frames", "%d frames, must be 2" % frames.size())
	var topic := _topic(frames[0])
	if topic == null:
		return _refuse("topic", "no stream is called that")
	fault_topic = topic.name
	if frames[1].size() > MAX_PAYLOAD_BYTES:
		return _refuse("oversized", "%d bytes, at most %d" % [frames[1].size(), MAX_PAYLOAD_BYTES])
	var envelope: Variant = _msgpack.unpack(frames[1])
	if not _msgpack.fault.is_empty():
		return _refuse(_msgpack.fault, "the payload is not one msgpack value within the limits")
	if not envelope is Dictionary:
		return _refuse("envelope", "a map is due")
	return _read(envelope, topic)


## The two frames of a message, or none and a `fault`: what a receiver would refuse is not sent.
func encode(message: Message) -> Array[PackedByteArray]:
	var name := message.topic.to_utf8_buffer()
	var payload := Msgpack.pack({
		"v": PROTOCOL_MAJOR,
		"src": message.src,
		"sid": message.sid,
		"seq": message.seq,
		"t": message.t,
		"t_pub": message.t_pub,
		"valid": message.valid,
		"data": message.data,
	})
	var frames: Array[PackedByteArray] = [name, payload]
	return frames if decode(frames) != null else ([] as Array[PackedByteArray])


## Whether a reader of this stream should forget all but the newest.
static func is_latest(user: String, stream: String) -> bool:
	return user != "sys" and Bodies.of_user[stream].latest


func _read(envelope: Dictionary, topic: Topic) -> Message:
	var version: Variant = envelope.get("v")
	if version is Msgpack.Foreign and not is_nan(version.number):
		return _refuse("version", "protocol %s, this side speaks %d" % [version.number, PROTOCOL_MAJOR])
	if not version is int:
		return _refuse("envelope", "v must be an int")
	if version != PROTOCOL_MAJOR:
		return _refuse("version", "protocol %s, this side speaks %d" % [version, PROTOCOL_MAJOR])
	var src: Variant = envelope.get("src")
	var sid: Variant = envelope.get("sid")
	var seq: Variant = envelope.get("seq")
	var t: Variant = envelope.get("t")
	var t_pub: Variant = envelope.get("t_pub")
	var valid: Variant = envelope.get("valid")
	if not (src is String and sid is String):
		return _refuse("envelope", "src and sid must be strings")
	if not seq is int or seq < 0:
		return _refuse("envelope", "seq must be an int from 0")
	if not (t is int and t_pub is int):
		return _refuse("envelope", "t and t_pub must be ints (ns) of 64 bits")
	if not valid is bool:
		return _refuse("envelope", "valid must be a bool")
	if not envelope.has("data"):
		return _refuse("envelope", "data is missing")
	var reading := Checks.Reading.new()
	var data: Variant = topic.entry.body.read(envelope["data"], reading)
	if not reading.fault.is_empty():
		return _refuse(reading.fault, reading.place if reading.place else "data")
	var message := Message.new()
	message.user = topic.user
	message.stream = topic.stream
	message.src = src
	message.sid = sid
	message.seq = seq
	message.t = t
	message.t_pub = t_pub
	message.valid = valid
	message.data = data
	return message


func _refuse(reason: String, why: String) -> Message:
	fault = reason
	detail = why
	return null


## Null for a name that is none of this version's.
func _topic(raw: PackedByteArray) -> Topic:
	if raw.size() > MAX_TOPIC_BYTES:
		return null
	if _topics.has(raw):
		return _topics[raw]
	var found: Topic = null
	if Msgpack.is_utf8(raw):
		var name := Msgpack.text(raw)
		var slash := name.find("/")
		var user := name.left(slash) if slash > 0 else ""
		var stream := name.substr(slash + 1)
		var streams: Dictionary = Bodies.of_system if user == "sys" else Bodies.of_user
		if _user.search(user) != null and streams.has(stream):
			found = Topic.new()
			found.name = name
			found.user = user
			found.stream = stream
			found.entry = streams[stream]
	if _topics.size() >= _MAX_KNOWN_TOPICS:
		_topics.clear()
	_topics[raw] = found
	return found
