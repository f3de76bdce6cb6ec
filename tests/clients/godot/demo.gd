extends SceneTree
## The example's scene beside a service: compares where the avatar's feet go with where the user's do. The one argument
## is JSON: {ingress, egress, control, seconds}.

const Frames := preload("res://addons/foottrack/foottrack_frames.gd")
const Body := preload("res://addons/foottrack/foottrack_body.gd")

var _client: Node
var _body: SkeletonModifier3D
var _skeleton: Skeleton3D
var _until_usec := 0
var _wanted_s := 0.0
var _samples := {"Left": [], "Right": []}


func _initialize() -> void:
	Engine.max_fps = 60
	var settings: Dictionary = JSON.parse_string(OS.get_cmdline_user_args()[0])
	var scene: Node = load("res://example/main.tscn").instantiate()
	_client = scene.get_node("FoottrackClient")
	_client.ingress_port = settings["ingress"]
	_client.egress_port = settings["egress"]
	_client.control_port = settings["control"]
	_skeleton = scene.get_node("Avatar")
	_body = scene.get_node("Avatar/FoottrackBody")
	_body.modification_processed.connect(_on_update)
	_wanted_s = settings["seconds"]
	root.add_child(scene)


func _on_update() -> void:
	var now := Time.get_ticks_usec()
	var message: RefCounted = _client.newest("pose/body")
	if message == null or not _client.is_synchronised():
		return
	if _until_usec == 0:
		_until_usec = now + int(_wanted_s * 1e6)
	for side: String in _samples:
		var foot: Variant = message.data[side.to_lower()]
		if foot == null or foot["stage"] == "lost" or _client.age(message) > Body.STALE_S:
			continue
		var bone := _skeleton.find_bone(side + "Foot")
		var shown := _skeleton.global_transform * _skeleton.get_bone_global_pose(bone).origin
		var told := Frames.vector(foot["ankle"]["p"])
		_samples[side].append([now * 1e-6, _numbers(shown), _numbers(told)])
	if now > _until_usec:
		print("LINE " + JSON.stringify({"kind": "moved", "feet": _samples, "scale": _skeleton.scale.y}))
		quit()


func _numbers(of: Vector3) -> Array:
	return [of.x, of.y, of.z]
