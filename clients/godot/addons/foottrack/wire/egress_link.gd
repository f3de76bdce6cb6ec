extends "link.gd"
## The way from the bus to here: subscribes, and knows when nothing is missed any more (SPEC, "Receiving from the first
## message on").

const _WELCOME := "sys/welcome"
const _TOKEN_BYTES := 16

## How often the bus was found; the number of losses is one less.
var welcomes := 0
## All subscriptions are in force.
var is_live := false
## Messages that came, each an Array[PackedByteArray]; whoever reads them takes them away.
var messages: Array[Array] = []

var _prefixes: Array[PackedByteArray] = []
var _welcome := _WELCOME.to_ascii_buffer()
var _token := PackedByteArray()


func _init(host: String, port: int, prefixes: PackedStringArray) -> void:
	super(host, port, "SUB")
	for prefix in prefixes:
		_prefixes.append(prefix.to_utf8_buffer())


func _ready_to_use(_now_usec: int) -> void:
	_zmtp.subscribe(_welcome)
	for prefix in _prefixes:
		_zmtp.subscribe(prefix)


func _received(frames: Array[PackedByteArray], _now_usec: int) -> void:
	if frames.size() != 1 or not _begins(frames[0], _welcome):
		# As libzmq does: what was not asked for is not taken, so that nobody fills the memory with made up users.
		if _prefixes.any(func(prefix: PackedByteArray) -> bool: return _begins(frames[0], prefix)):
			messages.append(frames)
	elif frames[0] == _welcome:
		_token = (_WELCOME + "/" + Crypto.new().generate_random_bytes(_TOKEN_BYTES).hex_encode()).to_ascii_buffer()
		_zmtp.subscribe(_token)
	elif frames[0] == _token:
		_zmtp.subscribe(_token, Zmtp.CANCEL)
		_token = PackedByteArray()
		welcomes += 1
		is_live = true


static func _begins(whole: PackedByteArray, prefix: PackedByteArray) -> bool:
	return whole.slice(0, prefix.size()) == prefix


func _ended() -> void:
	is_live = false
	_token = PackedByteArray()
