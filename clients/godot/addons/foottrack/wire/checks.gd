extends RefCounted
## What a value of the wire may be. `read` gives it as a receiver understands it (what may be absent filled in, unknown
## keys gone, unit lengths normalised) or sets the reading's fault. Checks have no state: threads may share them.

const Foreign := preload("msgpack.gd").Foreign
const BODY := "body"
const NOT_FINITE := "not_finite"
const UNIT_TOLERANCE := 1e-3
const SEMIDEFINITE_TOLERANCE := 1e-9
const MAX_ITEMS := 1024

enum Shape { FREE, UNIT, COVARIANCE }


## One pass over a body: its first fault, and the key it was found at.
class Reading:
	extends RefCounted
	var fault := ""
	var place := ""

	func refuse() -> Variant:
		fault = BODY
		return null

	## What stands where a number is due.
	func refuse_number(value: Variant) -> Variant:
		fault = NOT_FINITE if value is float and not is_finite(value) else BODY
		return null


class Check:
	extends RefCounted

	func read(_value: Variant, _reading: Reading) -> Variant:
		return null


class Number:
	extends Check
	var _least: float
	var _most: float

	func _init(least := -INF, most := INF) -> void:
		_least = least
		_most = most

	func read(value: Variant, reading: Reading) -> Variant:
		var number := NAN
		if value is float:
			number = value
		elif value is int:
			number = float(value)
		elif value is Foreign:
			number = value.number
		if not is_finite(number) or number < _least or number > _most:
			return reading.refuse_number(value)
		return number


class Integer:
	extends Check
	var _least: int
	var _most: int

	func _init(least := -0x7fffffffffffffff - 1, most := 0x7fffffffffffffff) -> void:
		_least = least
		_most = most

	func read(value: Variant, reading: Reading) -> Variant:
		if not value is int or value < _least or value > _most:
			return reading.refuse_number(value)
		return value


## Exactly of one of the engine's types.
class OfType:
	extends Check
	var _type: int

	func _init(type: int) -> void:
		_type = type

	func read(value: Variant, reading: Reading) -> Variant:
		return value if typeof(value) == _type else reading.refuse()


class OneOf:
	extends Check
	var _values: Array

	func _init(values: Array) -> void:
		_values = values

	func read(value: Variant, reading: Reading) -> Variant:
		return value if value is String and _values.has(value) else reading.refuse()


class Matching:
	extends Check
	var _pattern: RegEx

	func _init(pattern: String) -> void:
		_pattern = RegEx.create_from_string(pattern)

	func read(value: Variant, reading: Reading) -> Variant:
		return value if value is String and _pattern.search(value) != null else reading.refuse()


## So many numbers, as a PackedFloat64Array.
class Floats:
	extends Check
	var _count: int
	var _shape: Shape

	func _init(count: int, shape := Shape.FREE) -> void:
		_count = count
		_shape = shape

	func read(value: Variant, reading: Reading) -> Variant:
		if not value is Array or value.size() != _count:
			return reading.refuse()
		var numbers := PackedFloat64Array()
		numbers.resize(_count)
		for i in _count:
			var item: Variant = value[i]
			if not item is float:
				if not item is int and not item is Foreign:
					return reading.refuse_number(item)
				item = float(item) if item is int else item.number
			if not is_finite(item):
				return reading.refuse_number(item)
			numbers[i] = item
		if _shape == Shape.UNIT and not _normalise(numbers):
			return reading.refuse()
		if _shape == Shape.COVARIANCE and not _semidefinite(numbers):
			return reading.refuse()
		return numbers

	static func _normalise(numbers: PackedFloat64Array) -> bool:
		var square := 0.0
		for number in numbers:
			square += number * number
		var length := sqrt(square)
		if not absf(length - 1.0) <= UNIT_TOLERANCE:
			return false
		for i in numbers.size():
			numbers[i] /= length
		return true

	## `c` is xx, xy, xz, yy, yz, zz.
	static func _semidefinite(c: PackedFloat64Array) -> bool:
		var scale := 0.0
		for number in c:
			scale = maxf(scale, absf(number))
		if scale == 0.0:
			return true
		var xx := c[0] / scale
		var xy := c[1] / scale
		var xz := c[2] / scale
		var yy := c[3] / scale
		var yz := c[4] / scale
		var zz := c[5] / scale
		var determinant := xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
		var least := minf(minf(xx * yy - xy * xy, xx * zz - xz * xz), minf(yy * zz - yz * yz, determinant))
		return minf(xx, minf(yy, zz)) >= 0.0 and least >= -SEMIDEFINITE_TOLERANCE


## A key of a map. Without a default it is required; `nilable`: nil means the default too.
class Field:
	extends RefCounted
	var check: Check
	var required := true
	var nilable := false
	var default: Variant = null

	func _init(of: Check) -> void:
		check = of


## A map with known keys. `rule`, when given, judges the whole.
class Fields:
	extends Check
	var _names: PackedStringArray
	var _fields: Array[Field]
	var _rule: Callable

	func _init(fields: Dictionary, rule := Callable()) -> void:
		for name: String in fields:
			_names.append(name)
			_fields.append(fields[name] if fields[name] is Field else Field.new(fields[name]))
		_rule = rule

	func read(value: Variant, reading: Reading) -> Variant:
		if not value is Dictionary:
			return reading.refuse()
		var given: Dictionary = value
		var made := {}
		for i in _names.size():
			var name := _names[i]
			var field := _fields[i]
			var item: Variant = given.get(name)
			if item == null and not field.required and (field.nilable or not given.has(name)):
				made[name] = field.default
				continue
			made[name] = field.check.read(item, reading)
			if not reading.fault.is_empty():
				reading.place = name if reading.place.is_empty() else name + "." + reading.place
				return null
		if _rule.is_valid() and not _rule.call(made):
			return reading.refuse()
		return made


## A map of any names to values of one kind.
class MapOf:
	extends Check
	var _item: Check

	func _init(item: Check) -> void:
		_item = item

	func read(value: Variant, reading: Reading) -> Variant:
		if not value is Dictionary:
			return reading.refuse()
		var made := {}
		for key: Variant in value:
			made[key] = _item.read(value[key], reading) if key is String else reading.refuse()
			if not reading.fault.is_empty():
				reading.place = str(key) if reading.place.is_empty() else str(key) + "." + reading.place
				return null
		return made


class ListOf:
	extends Check
	var _item: Check

	func _init(item: Check) -> void:
		_item = item

	func read(value: Variant, reading: Reading) -> Variant:
		if not value is Array:
			return reading.refuse()
		var made := []
		for item: Variant in value:
			made.append(_item.read(item, reading))
			if not reading.fault.is_empty():
				return null
		return made


## One of several maps: the value of `kind` says which.
class ByKind:
	extends Check
	var _checks: Dictionary

	func _init(checks: Dictionary) -> void:
		_checks = checks

	func read(value: Variant, reading: Reading) -> Variant:
		if not value is Dictionary:
			return reading.refuse()
		var kind: Variant = value.get("kind")
		if not kind is String or not _checks.has(kind):
			reading.place = "kind"
			return reading.refuse()
		var check: Check = _checks[kind]
		return check.read(value, reading)


## Nil or absent: null.
static func nilable(check: Check) -> Field:
	return nil_or(null, check)


## Absent, not nil: the default.
static func absent_or(default: Variant, check: Check) -> Field:
	var field := Field.new(check)
	field.required = false
	field.default = default
	return field


## Nil or absent: the default.
static func nil_or(default: Variant, check: Check) -> Field:
	var field := absent_or(default, check)
	field.nilable = true
	return field
