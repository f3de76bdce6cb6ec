extends SceneTree
## The example's scene beside a service: compares where the avatar's feet go with where the user's do. The one argument
## is JSON: {ingress, egress, control, samples, lift}: it ends when both feet were seen so often, and lifted so high.

const Frames := preload("res://addons/foottrack/foottrack_frames.gd")
const Body := preload("res://addons/foottrack/foottrack_body.gd")

var _client: Node
var _body: SkeletonModifier3D
var _skeleton: Skeleton3D
var _wanted := 0
var _lift := 0.0
var _samples := {"Left": [], "Right": []}
var _known_since := {"Left": -1, "Right": -1}


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
	_wanted = settings["samples"]
	_lift = settings["lift"]
	root.add_child(scene)


func _on_update() -> void:
	var now := Time.get_ticks_usec()
	var message: RefCounted = _client.newest("pose/body")
	if message == null or not _client.is_synchronised():
		return
	for side: String in _samples:
		var foot: Variant = message.data[side.to_lower()]
		var age: float = _client.age(message)
		if foot == null or foot["stage"] == "lost" or not message.valid or age > Body.STALE_S:
			_known_since[side] = -1
			continue
		if _known_since[side] < 0:
			_known_since[side] = now
		# Before, it comes from where it hung.
		if now - _known_since[side] < 2e6 * Body.RELEASE_S:
			continue
		var bone := _skeleton.find_bone(side + "Foot")
		var shown := _skeleton.global_transform * _skeleton.get_bone_global_pose(bone).origin
		var ahead := clampf(age, 0.0, Body.MAX_EXTRAPOLATION_S)
		var told := Frames.vector(foot["ankle"]["p"]) + ahead * Frames.vector(foot["v"])
		_samples[side].append([now * 1e-6, _numbers(shown), _numbers(told)])
	if _is_enough(_samples["Left"]) and _is_enough(_samples["Right"]):
		print("LINE " + JSON.stringify({"kind": "moved", "feet": _samples, "scale": _skeleton.scale.y}))
		quit()


func _is_enough(samples: Array) -> bool:
	var heights := samples.map(func(each: Array) -> float: return each[2][1])
	return samples.size() >= _wanted and heights.max() - heights.min() > _lift


func _numbers(of: Vector3) -> Array:
	return [of.x, of.y, of.z]
