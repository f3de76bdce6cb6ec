extends RefCounted
## Msgpack within the limits of the wire (SPEC, sections 2 and 10). Any bytes give a value or a fault, nothing else.
##
## map: Dictionary; array: Array; str: String; bin: PackedByteArray; int: int; float: float. Strings cannot hold NUL in
## this engine: it becomes U+FFFD.

const MAX_DEPTH := 12
const MAX_ITEMS := 1024
const FAULT_MSGPACK := "msgpack"
const FAULT_DEPTH := "depth"
const _MAX_INTERNED_BYTES := 32
const _MAX_INTERNED := 1024


## What this engine has no type for: an integer beyond 63 bits (`number` is the nearest float), or an extension (NAN).
class Foreign:
	extends RefCounted
	var number := NAN


## Why the last `unpack` failed; empty when it did not.
var fault := ""
var _bytes: PackedByteArray
## The engine's decode functions are little-endian: a number at position p is read from the mirrored bytes.
var _mirrored: PackedByteArray
var _size := 0
var _at := 0
## The same few keys come in each message: comparing bytes is quicker than decoding UTF-8.
var _interned := {}


## The one value that fills `bytes`, or null and a `fault`.
func unpack(bytes: PackedByteArray) -> Variant:
	fault = ""
	_bytes = bytes
	_mirrored = bytes.duplicate()
	_mirrored.reverse()
	_size = bytes.size()
	_at = 0
	var value: Variant = _value(1)
	if fault.is_empty() and _at != _size:
		fault = FAULT_MSGPACK
	return value if fault.is_empty() else null


## The bytes of a value made of null, bool, int, float, String, PackedByteArray, PackedFloat64Array, Array, Dictionary.
static func pack(value: Variant) -> PackedByteArray:
	var into := StreamPeerBuffer.new()
	into.big_endian = true
	_pack(value, into)
	return into.data_array


func _value(depth: int) -> Variant:
	if _at >= _size:
		return _fail()
	var tag := _bytes[_at]
	_at += 1
	if tag < 0x80:
		return tag
	if tag == 0xcb:
		return _mirrored.decode_double(_size - _at) if _take(8) else _fail()
	if tag < 0xc0:
		if tag < 0x90:
			return _map(tag & 0x0f, depth)
		return _array(tag & 0x0f, depth) if tag < 0xa0 else _string(tag & 0x1f)
	if tag >= 0xe0:
		return tag - 256
	match tag:
		0xc0: return null
		0xc2: return false
		0xc3: return true
		0xc4, 0xc5, 0xc6: return _binary(_length(1 << (tag - 0xc4)))
		0xc7, 0xc8, 0xc9: return _extension(_length(1 << (tag - 0xc7)))
		0xca: return _mirrored.decode_float(_size - _at) if _take(4) else _fail()
		0xcc: return _mirrored.decode_u8(_size - _at) if _take(1) else _fail()
		0xcd: return _mirrored.decode_u16(_size - _at) if _take(2) else _fail()
		0xce: return _mirrored.decode_u32(_size - _at) if _take(4) else _fail()
		0xcf: return _unsigned_64()
		0xd0: return _mirrored.decode_s8(_size - _at) if _take(1) else _fail()
		0xd1: return _mirrored.decode_s16(_size - _at) if _take(2) else _fail()
		0xd2: return _mirrored.decode_s32(_size - _at) if _take(4) else _fail()
		0xd3: return _mirrored.decode_s64(_size - _at) if _take(8) else _fail()
		0xd4, 0xd5, 0xd6, 0xd7, 0xd8: return _extension(1 << (tag - 0xd4))
		0xd9, 0xda, 0xdb: return _string(_length(1 << (tag - 0xd9)))
		0xdc, 0xdd: return _array(_length(2 << (tag - 0xdc)), depth)
		0xde, 0xdf: return _map(_length(2 << (tag - 0xde)), depth)
	return _fail()


func _map(count: int, depth: int) -> Variant:
	# Two bytes are the least that a pair takes: a header that lies gets no memory.
	if count < 0 or count > MAX_ITEMS or count * 2 > _size - _at:
		return _fail()
	if depth > MAX_DEPTH:
		return _fail(FAULT_DEPTH)
	var map := {}
	for _i in count:
		var key: Variant = _value(depth + 1)
		if not (key is String or key is PackedByteArray):
			return _fail()
		map[key] = _value(depth + 1)
		if not fault.is_empty():
			return null
	return map


func _array(count: int, depth: int) -> Variant:
	if count < 0 or count > MAX_ITEMS or count > _size - _at:
		return _fail()
	if depth > MAX_DEPTH:
		return _fail(FAULT_DEPTH)
	var array := []
	array.resize(count)
	for i in count:
		array[i] = _value(depth + 1)
		if not fault.is_empty():
			return null
	return array


func _string(length: int) -> Variant:
	if length < 0 or not _take(length):
		return _fail()
	var raw := _bytes.slice(_at - length, _at)
	if length > _MAX_INTERNED_BYTES:
		return text(raw) if is_utf8(raw) else _fail()
	var known: Variant = _interned.get(raw)
	if known != null:
		return known
	if not is_utf8(raw):
		return _fail()
	var made := text(raw)
	if _interned.size() >= _MAX_INTERNED:
		_interned.clear()
	_interned[raw] = made
	return made


func _binary(length: int) -> Variant:
	return _bytes.slice(_at - length, _at) if length >= 0 and _take(length) else _fail()


func _extension(length: int) -> Variant:
	return Foreign.new() if length >= 0 and _take(length + 1) else _fail()


func _unsigned_64() -> Variant:
	if not _take(8):
		return _fail()
	var low := _mirrored.decode_s64(_size - _at)
	if low >= 0:
		return low
	var foreign := Foreign.new()
	foreign.number = float(low) + 18446744073709551616.0
	return foreign


## A length of 1, 2 or 4 bytes, or -1.
func _length(width: int) -> int:
	if not _take(width):
		return -1
	match width:
		1: return _mirrored.decode_u8(_size - _at)
		2: return _mirrored.decode_u16(_size - _at)
	return _mirrored.decode_u32(_size - _at)


func _take(count: int) -> bool:
	if count > _size - _at:
		return false
	_at += count
	return true


func _fail(why := FAULT_MSGPACK) -> Variant:
	if fault.is_empty():
		fault = why
	return null


## Whether bytes are UTF-8 (no overlong forms, no surrogates). The engine's own decoder prints errors instead.
static func is_utf8(bytes: PackedByteArray) -> bool:
	var i := 0
	var size := bytes.size()
	while i < size:
		var first := bytes[i]
		i += 1
		if first < 0x80:
			continue
		var more := 1 if first < 0xe0 else 2 if first < 0xf0 else 3
		if first < 0xc2 or first > 0xf4 or i + more > size:
			return false
		var second := bytes[i]
		if (first == 0xe0 and second < 0xa0) or (first == 0xed and second > 0x9f):
			return false
		if (first == 0xf0 and second < 0x90) or (first == 0xf4 and second > 0x8f):
			return false
		for _j in more:
			if bytes[i] & 0xc0 != 0x80:
				return false
			i += 1
	return true


## The string in bytes that are UTF-8.
static func text(bytes: PackedByteArray) -> String:
	if bytes.find(0) < 0:
		return bytes.get_string_from_utf8()
	var parts := PackedStringArray()
	var begin := 0
	for i in bytes.size() + 1:
		if i == bytes.size() or bytes[i] == 0:
			parts.append(bytes.slice(begin, i).get_string_from_utf8())
			begin = i + 1
	return "\ufffd".join(parts)


static func _pack(value: Variant, into: StreamPeerBuffer) -> void:
	match typeof(value):
		TYPE_NIL:
			into.put_u8(0xc0)
		TYPE_BOOL:
			into.put_u8(0xc3 if value else 0xc2)
		TYPE_INT:
			_pack_int(value, into)
		TYPE_FLOAT:
			into.put_u8(0xcb)
			into.put_double(value)
		TYPE_STRING, TYPE_STRING_NAME:
			var raw := String(value).to_utf8_buffer()
			_pack_header(raw.size(), 0xa0, 32, [0xd9, 0xda, 0xdb], into)
			into.put_data(raw)
		TYPE_PACKED_BYTE_ARRAY:
			_pack_header(value.size(), 0, 0, [0xc4, 0xc5, 0xc6], into)
			into.put_data(value)
		TYPE_ARRAY, TYPE_PACKED_FLOAT64_ARRAY:
			_pack_header(value.size(), 0x90, 16, [0, 0xdc, 0xdd], into)
			for item: Variant in value:
				_pack(item, into)
		TYPE_DICTIONARY:
			_pack_header(value.size(), 0x80, 16, [0, 0xde, 0xdf], into)
			for key: String in value:
				_pack(key, into)
				_pack(value[key], into)
		_:
			assert(false, "%s has no place on the wire" % type_string(typeof(value)))


static func _pack_int(value: int, into: StreamPeerBuffer) -> void:
	if value >= -32 and value < 128:
		into.put_8(value)
	elif value >= -128 and value < 0:
		into.put_u8(0xd0)
		into.put_8(value)
	else:
		into.put_u8(0xd3)
		into.put_64(value)


## `wide` are the tags for lengths of 1, 2 and 4 bytes; 0 where there is none.
static func _pack_header(count: int, fix: int, fix_limit: int, wide: Array, into: StreamPeerBuffer) -> void:
	if count < fix_limit:
		into.put_u8(fix | count)
	elif count < 0x100 and wide[0] != 0:
		into.put_u8(wide[0])
		into.put_u8(count)
	elif count < 0x10000:
		into.put_u8(wide[1])
		into.put_u16(count)
	else:
		into.put_u8(wide[2])
		into.put_u32(count)
