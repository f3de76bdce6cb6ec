extends "link.gd"
## The way from here to the bus: publishes once the bus has subscribed to everything (SPEC, "Publishing without losing
## the first messages").

## What may wait for a bus that does not keep up.
const MAX_BACKLOG_BYTES := 1024 * 1024

## Messages handed to the bus, and those that were not, by reason.
var sent := 0
var drops := {"no_bus": 0, "full": 0}
var _subscriptions := {}


func _init(host: String, port: int) -> void:
	super(host, port, "XPUB")


## Whether the bus takes what is published now.
func is_live() -> bool:
	return _subscriptions.has(PackedByteArray())


func publish(frames: Array[PackedByteArray]) -> bool:
	if not is_live():
		drops["no_bus"] += 1
		return false
	if backlog() > MAX_BACKLOG_BYTES:
		drops["full"] += 1
		return false
	_zmtp.send(frames)
	sent += 1
	_flush()
	return true


func _received(frames: Array[PackedByteArray], _now_usec: int) -> void:
	var what := frames[0]
	if frames.size() != 1 or what.size() != 1:
		return
	# Only what concerns everything is of interest: the ingress wants all or nothing.
	if what[0] == Zmtp.SUBSCRIBE:
		_subscriptions[what.slice(1)] = true
	elif what[0] == Zmtp.CANCEL:
		_subscriptions.erase(what.slice(1))


func _ended() -> void:
	_subscriptions.clear()
