extends SceneTree
## Decodes every golden vector (the folder is the one argument) and prints one line of JSON: how many, and what differs.

const Envelope := preload("res://addons/foottrack/wire/envelope.gd")

var _differences: Array[String] = []


func _init() -> void:
	var folder := OS.get_cmdline_user_args()[0]
	var valid := 0
	var invalid := 0
	for file in DirAccess.get_files_at(folder):
		var vectors: Array = JSON.parse_string(FileAccess.get_file_as_string(folder.path_join(file)))["vectors"]
		for vector: Dictionary in vectors:
			if file == "invalid.json":
				_refused(vector)
				invalid += 1
			else:
				_understood(vector)
				valid += 1
	print("LINE " + JSON.stringify({"valid": valid, "invalid": invalid, "differences": _differences}))
	quit()


func _understood(vector: Dictionary) -> void:
	var payload: PackedByteArray = vector["payload_hex"].hex_decode()
	payload.resize(payload.size() + int(vector.get("payload_zeros", 0)))
	var envelope := Envelope.new()
	var frames: Array[PackedByteArray] = [vector["topic_hex"].hex_decode(), payload]
	var message := envelope.decode(frames)
	if message == null:
		_differences.append("%s: refused, %s (%s)" % [vector["name"], envelope.fault, envelope.detail])
		return
	if message.topic != vector["topic"]:
		_differences.append("%s: topic %s" % [vector["name"], message.topic])
	var due: Dictionary = vector["message"]
	for key in ["src", "sid", "seq", "t", "t_pub", "valid", "data"]:
		_compare(message.get(key), due[key], "%s: %s" % [vector["name"], key])
	var again := envelope.encode(message)
	if again.is_empty():
		_differences.append("%s: cannot be sent again, %s" % [vector["name"], envelope.fault])
	else:
		var twice := envelope.decode(again)
		_compare(twice.data, due["data"], "%s, sent again" % vector["name"])


func _refused(vector: Dictionary) -> void:
	var frames: Array[PackedByteArray] = []
	for hex: String in vector["frames_hex"]:
		frames.append(hex.hex_decode())
	if not frames.is_empty():
		var last := frames[-1]
		last.resize(last.size() + int(vector.get("last_frame_zeros", 0)))
		frames[-1] = last
	var envelope := Envelope.new()
	if envelope.decode(frames) != null:
		_differences.append("%s: taken" % vector["name"])
	elif envelope.fault != vector["reason"]:
		_differences.append("%s: refused for %s, not %s" % [vector["name"], envelope.fault, vector["reason"]])


func _compare(got: Variant, due: Variant, where: String) -> void:
	if got is PackedFloat64Array:
		got = Array(got)
	if got is PackedByteArray:
		got = Marshalls.raw_to_base64(got)
	if due is Dictionary and got is Dictionary and got.size() == due.size():
		for key: String in due:
			if not got.has(key):
				_differences.append("%s.%s: missing" % [where, key])
			else:
				_compare(got[key], due[key], where + "." + key)
	elif due is Array and got is Array and got.size() == due.size():
		for i: int in due.size():
			_compare(got[i], due[i], "%s[%d]" % [where, i])
	elif due is float and (got is int or got is float):
		if absf(float(got) - due) > 1e-9 * maxf(1.0, absf(due)):
			_differences.append("%s: %s, not %s" % [where, got, due])
	elif typeof(got) != typeof(due) or got != due:
		_differences.append("%s: %s, not %s" % [where, got, due])
