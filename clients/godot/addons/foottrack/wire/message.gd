class_name FoottrackMessage
extends RefCounted
## One message of the bus. Stamps are ns of the bus clock; `data` is the body as SPEC's section 6 has it: Dictionaries,
## and PackedFloat64Array for vectors and quaternions (`FoottrackFrames` makes engine values of them).

var user: String
var stream: String
var src: String
var sid: String
var seq: int
var t: int
var t_pub: int
## The publisher's own inputs were healthy. Otherwise show it as such, and use it for nothing else.
var valid: bool
var data: Dictionary
## When the receiving thread had it, `Time.get_ticks_usec()`.
var arrival_usec: int

var topic: String:
	get:
		return user + "/" + stream
