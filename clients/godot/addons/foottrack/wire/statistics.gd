extends RefCounted
## What a receiver counts (SPEC, sections 2 and 10): messages, gaps, refusals by reason, arrivals.

const Message := preload("message.gd")

## A producer that makes up users must not fill the memory.
const MAX_TOPICS := 1000
## A forgotten run of a publisher only misses its next gap.
const MAX_RUNS := 4096

## By topic: {messages, gaps, drops: {reason: count}, arrival_usec}.
var topics := {}
## Refusals that name no topic, by reason.
var drops := {}
var _last := {}


func accept(message: Message) -> void:
	var topic := message.topic
	var counted := _of(topic)
	counted["messages"] += 1
	counted["arrival_usec"] = message.arrival_usec
	var run := topic + "\n" + message.src + "\n" + message.sid
	var last: int = _last.get(run, -1)
	if last < 0:
		if _last.size() >= MAX_RUNS:
			_last.erase(_last.keys()[0])
	elif message.seq > last + 1:
		counted["gaps"] += message.seq - last - 1
	_last[run] = message.seq


func refuse(reason: String, topic: String) -> void:
	var by_reason: Dictionary = drops if topic.is_empty() else _of(topic)["drops"]
	by_reason[reason] = by_reason.get(reason, 0) + 1


func _of(topic: String) -> Dictionary:
	if topics.has(topic):
		return topics[topic]
	var made := {"messages": 0, "gaps": 0, "drops": {}, "arrival_usec": -1}
	if topics.size() < MAX_TOPICS:
		topics[topic] = made
	return made
