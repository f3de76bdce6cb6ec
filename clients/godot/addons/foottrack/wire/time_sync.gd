extends RefCounted
## The bus clock for an engine that counts from its own start (SPEC, section 3). All values are ns.

const BURST := 8
const PERIOD := 2_000_000_000
const MAX_ROUND_TRIP := 128_000_000
const MAX_AGE := 10_000_000_000
## Two clocks with crystals of 50 ppm each.
const MAX_DRIFT := 100e-6

## Bus clock minus own clock; 0 as long as there `is_known` none.
var offset := 0
var is_known := false
var _half_width := 0
var _at := 0
var _measured := 0


## Takes the exchanges of a burst, each [own clock before, bus clock, own clock after].
func on_burst(exchanges: Array[PackedInt64Array]) -> void:
	var best := PackedInt64Array()
	var least := MAX_ROUND_TRIP + 1
	for exchange in exchanges:
		var round_trip := exchange[2] - exchange[0]
		if round_trip >= 0 and round_trip < least:
			least = round_trip
			best = exchange
	if best.is_empty():
		return
	@warning_ignore("integer_division")
	var middle := best[0] + least / 2
	@warning_ignore("integer_division")
	var half_width := (least + 1) / 2
	_measured = middle
	var found := best[1] - middle
	var before := uncertainty(middle)
	if not is_known or half_width <= before or absi(found - offset) > half_width + before:
		offset = found
		_half_width = half_width
		_at = middle
		is_known = true


## Half-width of the interval that holds the true offset.
func uncertainty(own: int) -> int:
	return _half_width + int(absi(own - _at) * MAX_DRIFT)


## Whether stamps may be trusted.
func is_fresh(own: int) -> bool:
	return own <= fresh_until()


## Own clock up to which stamps may be trusted when no burst succeeds any more.
func fresh_until() -> int:
	return _measured + MAX_AGE if is_known else -1


## The service is another one: its clock may be too.
func forget() -> void:
	is_known = false
	offset = 0
