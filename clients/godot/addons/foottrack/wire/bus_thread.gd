extends RefCounted
## The thread that talks to the service, so that the engine's main thread never waits for it: receives and decodes,
## publishes, keeps the time. Everything public is called by the main thread.

const Envelope := preload("envelope.gd")
const EgressLink := preload("egress_link.gd")
const IngressLink := preload("ingress_link.gd")
const ControlLink := preload("control_link.gd")
const RequestLink := preload("request_link.gd")
const Message := preload("message.gd")
const Statistics := preload("statistics.gd")
const TimeSync := preload("time_sync.gd")

## A main thread that does not come back for so many messages loses the oldest, and that is counted.
const MAX_WAITING := 10_000
const _BUSY_USEC := 300
const _WAITING_FOR_TIME_USEC := 50
const _AWAY_USEC := 10_000
const _STATE_PERIOD_USEC := 100_000


## What the main thread has not seen yet.
class Batch:
	extends RefCounted
	## Of streams where only the newest counts, by topic.
	var newest := {}
	## All of the others, in order.
	var every: Array[Message] = []
	## What the service answered, by the request's id.
	var answers := {}
	## The last refusal: [topic, reason, detail]; empty without one.
	var refusal: Array = []


var _thread := Thread.new()
var _mutex := Mutex.new()
var _stop := false
# Guarded by the mutex.
var _batch := Batch.new()
var _outbox: Array[Message] = []
var _requests: Array[RequestLink.Request] = []
var _statistics := Statistics.new()
var _state := {}
var _overflow := 0
var _live := false
var _offset := 0
var _fresh_until_ns := 0


func start(host: String, ingress: int, egress: int, control: int, prefixes: PackedStringArray) -> void:
	_thread.start(_run.bind(host, ingress, egress, control, prefixes))


## Ends the thread.
func stop() -> void:
	_mutex.lock()
	_stop = true
	_mutex.unlock()
	_thread.wait_to_finish()


func take() -> Batch:
	var fresh := Batch.new()
	_mutex.lock()
	var batch := _batch
	_batch = fresh
	_mutex.unlock()
	return batch


## Sends a message as soon as the thread comes round; `seq` and `t_pub` are its own doing.
func publish(message: Message) -> void:
	_mutex.lock()
	_outbox.append(message)
	_mutex.unlock()


## Asks the service; the answer comes with a batch.
func ask(request: RequestLink.Request) -> void:
	_mutex.lock()
	_requests.append(request)
	_mutex.unlock()


## How it is: counters and connections, a copy.
func state() -> Dictionary:
	_mutex.lock()
	var made := _state.duplicate()
	made["topics"] = _statistics.topics.duplicate(true)
	made["drops"] = _statistics.drops.duplicate()
	made["overflow"] = _overflow
	_mutex.unlock()
	return made


## Bus clock minus own clock, ns.
func offset() -> int:
	_mutex.lock()
	var found := _offset
	_mutex.unlock()
	return found


## What keeps a connection from standing, for a person; empty when nothing does.
func fault() -> String:
	_mutex.lock()
	var found: String = _state.get("fault", "")
	_mutex.unlock()
	return found


## Whether all subscriptions are in force.
func is_live() -> bool:
	_mutex.lock()
	var live := _live
	_mutex.unlock()
	return live


func is_synchronised() -> bool:
	_mutex.lock()
	var fresh := Time.get_ticks_usec() * 1000 <= _fresh_until_ns
	_mutex.unlock()
	return fresh


func _run(host: String, ingress: int, egress: int, control: int, prefixes: PackedStringArray) -> void:
	var down := EgressLink.new(host, egress, prefixes)
	var up := IngressLink.new(host, ingress)
	var asks := ControlLink.new(host, control)
	var wants := RequestLink.new(host, control)
	var decoder := Envelope.new()
	var next_seq := {}
	var next_state_usec := 0
	while true:
		var now := Time.get_ticks_usec()
		var came := asks.poll(now)
		came = up.poll(now) or came
		came = down.poll(now) or came
		came = wants.poll(now) or came
		var batch := _decode(down, asks, decoder)
		_mutex.lock()
		var stopping := _stop
		_keep(batch)
		_batch.answers.merge(wants.answers)
		wants.answers.clear()
		_offset = asks.time.offset
		_fresh_until_ns = asks.time.fresh_until()
		if now >= next_state_usec or down.is_live != _live:
			_live = down.is_live
			next_state_usec = now + _STATE_PERIOD_USEC
			_state = _describe(down, up, asks, wants)
		var outbox := _outbox
		_outbox = []
		var requests := _requests
		_requests = []
		_mutex.unlock()
		for request in requests:
			wants.ask(request)
		for message in outbox:
			_send(message, up, asks.time, decoder, next_seq)
		if stopping:
			break
		if not came:
			OS.delay_usec(_WAITING_FOR_TIME_USEC if asks.is_waiting() else _pause(down, up, wants))
	for link in [down, up, asks, wants]:
		link.close()


## What came, decoded: messages, and [topic, reason, detail] for what was none.
func _decode(down: EgressLink, asks: ControlLink, decoder: Envelope) -> Array:
	var made := []
	for frames: Array[PackedByteArray] in down.messages:
		var message := decoder.decode(frames)
		if message == null:
			made.append([decoder.fault_topic, decoder.fault, decoder.detail])
			continue
		message.arrival_usec = Time.get_ticks_usec()
		if message.user == "sys" and message.stream == "session":
			asks.on_session(message.data["session"])
		made.append(message)
	down.messages = []
	return made


func _keep(made: Array) -> void:
	for item: Variant in made:
		if item is Array:
			_statistics.refuse(item[1], item[0])
			_batch.refusal = item
			continue
		var message: Message = item
		_statistics.accept(message)
		if Envelope.is_latest(message.user, message.stream):
			_batch.newest[message.topic] = message
		else:
			_batch.every.append(message)
	if _batch.every.size() > MAX_WAITING:
		_overflow += _batch.every.size() - MAX_WAITING
		_batch.every = _batch.every.slice(-MAX_WAITING)


func _send(message: Message, up: IngressLink, time: TimeSync, encoder: Envelope, next_seq: Dictionary) -> void:
	var own := Time.get_ticks_usec() * 1000
	var seq: int = next_seq.get(message.topic, 0)
	message.seq = seq
	message.t += time.offset
	message.t_pub = own + time.offset
	message.valid = message.valid and time.is_fresh(own)
	var frames := encoder.encode(message)
	if frames.is_empty():
		push_error("foottrack: cannot publish %s: %s (%s)" % [message.topic, encoder.fault, encoder.detail])
		return
	next_seq[message.topic] = seq + 1
	up.publish(frames)


static func _describe(down: EgressLink, up: IngressLink, asks: ControlLink, wants: RequestLink) -> Dictionary:
	var own := Time.get_ticks_usec() * 1000
	return {
		"connected": down.is_live,
		"welcomes": down.welcomes,
		"publishing": up.is_live(),
		"sent": up.sent,
		"unsent": up.drops.duplicate(),
		"session": asks.session,
		"uncertainty_ns": asks.time.uncertainty(own) if asks.time.is_known else -1,
		"violations": down.violations + up.violations + asks.violations + wants.violations,
		"stalls": down.stalls + up.stalls + asks.stalls + wants.stalls,
		"bad_answers": asks.bad_answers,
		"fault": _fault(down, up, asks),
	}


## What keeps one of the three connections from standing, for a person.
static func _fault(down: EgressLink, up: IngressLink, asks: ControlLink) -> String:
	if not down.is_live:
		return down.last_fault
	if not up.is_live():
		return up.last_fault
	return "" if asks.is_ready() else asks.last_fault


static func _pause(down: EgressLink, up: IngressLink, wants: RequestLink) -> int:
	return _BUSY_USEC if down.is_ready() or up.is_ready() or wants.is_waiting() else _AWAY_USEC
