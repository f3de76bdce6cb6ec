extends SceneTree
## Poses the example's avatar from messages, and says where its bones are. The one argument is JSON:
## {follow, frames: [topic hex, payload hex], turned?, age?, updates?, eyes?: "camera" | "origin"}.

const Client := preload("res://addons/foottrack/foottrack_client.gd")
const Body := preload("res://addons/foottrack/foottrack_body.gd")
const Avatar := preload("res://example/avatar.gd")
const Envelope := preload("res://addons/foottrack/wire/envelope.gd")
const Message := preload("res://addons/foottrack/wire/message.gd")
const BONES := ["Hips", "LeftUpperLeg", "LeftLowerLeg", "LeftFoot", "RightUpperLeg", "RightLowerLeg", "RightFoot"]


## A client without a service: there is one message, and it is true right now.
class Fixed:
	extends Client
	var message: Message
	var seconds := 0.0

	func _enter_tree() -> void:
		pass

	func _exit_tree() -> void:
		pass

	func _process(_delta: float) -> void:
		pass

	func newest(stream: String) -> Message:
		return message if message.stream == stream else null

	func age(_message: Message) -> float:
		return seconds


var _avatar: Skeleton3D
var _body: Body
var _camera: Camera3D
var _rest := {}
var _updates := 0
var _wanted := 0


func _initialize() -> void:
	var settings: Dictionary = JSON.parse_string(OS.get_cmdline_user_args()[0])
	_wanted = settings.get("updates", 60)
	var client := Fixed.new()
	var frames: Array[PackedByteArray] = []
	for hex: String in settings["frames"]:
		frames.append(hex.hex_decode())
	client.message = Envelope.new().decode(frames)
	client.seconds = settings.get("age", 0.0)
	root.add_child(client)
	_avatar = Avatar.new()
	_avatar.rotation.y = settings.get("turned", 0.0)
	_body = Body.new()
	_body.client = client
	_body.follow = settings["follow"]
	_avatar.add_child(_body)
	root.add_child(_avatar)
	if settings.get("eyes", "") == "camera":
		_body.eyes = Camera3D.new()
		root.add_child(_body.eyes)
	elif settings.get("eyes", "") == "origin":
		var origin := XROrigin3D.new()
		_camera = XRCamera3D.new()
		_camera.position = Vector3(0.3, 1.6, 0.2)
		origin.add_child(_camera)
		root.add_child(origin)
		_camera.make_current()
		_body.stage = origin
		_body.eyes = origin
	for bone: String in BONES:
		_rest[bone] = _avatar.get_bone_global_rest(_avatar.find_bone(bone))
	_body.modification_processed.connect(_on_update)


func _on_update() -> void:
	_updates += 1
	if _updates != _wanted:
		return
	var said := {"scale": _avatar.scale.y, "place": _numbers(_avatar.global_position)}
	for bone: String in BONES:
		var pose := _avatar.global_transform * _avatar.get_bone_global_pose(_avatar.find_bone(bone))
		# How the bone is turned from how it stands at rest when the model faces -Z.
		var rest: Basis = Basis(Vector3.UP, PI) * _rest[bone].basis
		var turned := (pose.basis.orthonormalized() * rest.inverse()).get_rotation_quaternion()
		said[bone] = {"p": _numbers(pose.origin), "q": [turned.x, turned.y, turned.z, turned.w]}
	if _body.eyes != null:
		said["eyes"] = {"p": _numbers(_body.eyes.global_position), "forward": _numbers(-_body.eyes.global_basis.z)}
	if _camera != null:
		said["eyes"]["camera"] = _numbers(_camera.global_position)
	print("LINE " + JSON.stringify(said))
	quit()


func _numbers(of: Vector3) -> Array:
	return [of.x, of.y, of.z]
