@icon("icon.svg")
class_name FoottrackBody
extends SkeletonModifier3D
## Drives hips, legs and feet of a Skeleton3D with humanoid bone names. Make it a child of the skeleton: it comes after
## animations and leaves the upper body to them.
##
## What is not known is not made up: a foot that is lost, not valid or silent goes to where it hangs at rest, within
## `RELEASE_S`, and comes back the same way.

const Client := preload("foottrack_client.gd")
const Frames := preload("foottrack_frames.gd")
const Humanoid := preload("body/humanoid.gd")
const Message := preload("wire/message.gd")

## Where the targets come from.
enum Follow {
	## `pose/body`: the avatar's feet are where the user's feet are.
	TRACKED,
	## `pose/ik`: the avatar walks where the user walks in place.
	WALK_IN_PLACE,
}

const RELEASE_S := 0.2
## A pose that is older is no pose any more.
const STALE_S := 0.5
## Feet are not carried further than this by their published velocity.
const MAX_EXTRAPOLATION_S := 0.1
const _KEYS := {"Left": "left", "Right": "right"}

@export var client: Client
## What the poses are in: the XROrigin3D; the world if there is none.
@export var stage: Node3D
@export var follow := Follow.TRACKED
## Scale the skeleton so that its legs are as long as the user's.
@export var scale_to_user := true
## A Camera3D, or an XROrigin3D with its camera, to be put at the avatar's eyes; none: left alone.
@export var eyes: Node3D
## Of the avatar's eyes in its head bone's place, facing -Z, in metres of the model.
@export var eye_offset := Vector3(0.0, 0.06, -0.08)
## The user's ankle joint above the sole, as the service is set up (`[feet.left] ankle_height`).
@export var ankle_height := 0.09
## What the picture will show is so much later than `_process`, s: feet are predicted to that.
@export var lead := 0.0

var _humanoid: Humanoid
var _weights := {"Hips": 0.0, "Left": 0.0, "Right": 0.0}
var _delta := 0.0
var _shift := Vector3.ZERO


func _process(delta: float) -> void:
	_delta += delta
	if client == null or _rig() == null:
		return
	if scale_to_user:
		_scale()
	if follow == Follow.WALK_IN_PLACE:
		_walk(delta)


func _process_modification() -> void:
	if client == null or _rig() == null:
		return
	if follow == Follow.TRACKED:
		_track()
	else:
		_step()
	_delta = 0.0
	if eyes != null:
		_look()


func _rig() -> Humanoid:
	var skeleton := get_skeleton()
	if _humanoid == null and skeleton != null:
		_humanoid = Humanoid.new(skeleton)
		if not _humanoid.missing.is_empty():
			push_error("foottrack: %s lacks the bones %s" % [skeleton.name, ", ".join(_humanoid.missing)])
	return _humanoid if _humanoid != null and _humanoid.missing.is_empty() else null


## A message that may be shown, or null.
func _fresh(stream: String) -> Message:
	var message := client.newest(stream)
	return message if message != null and message.valid and client.age(message) < STALE_S else null


func _track() -> void:
	var skeleton := get_skeleton()
	var message := _fresh("pose/body")
	var body: Dictionary = message.data if message != null else {}
	var to_skeleton := skeleton.global_transform.affine_inverse() * _stage_in_world()
	# The soles, not the ankles, are to be as high as the user's.
	var lift := Vector3.UP * (_humanoid.ankle_height() / to_skeleton.basis.get_scale().y - ankle_height)
	var ankles := {}
	var knees := {}
	for side: String in Humanoid.SIDES:
		var foot: Variant = body.get(_KEYS[side])
		if foot == null or foot["stage"] == "lost":
			continue
		var ahead := clampf(client.age(message) + lead, 0.0, MAX_EXTRAPOLATION_S)
		var moved := Frames.vector(foot["v"]) * ahead
		ankles[side] = _placed(to_skeleton, foot["ankle"], lift + moved)
		if foot["knee"] != null:
			knees[side] = to_skeleton * (Frames.vector(foot["knee"]) + lift + 0.5 * moved)
	var hips := _humanoid.hips_over(ankles)
	var weight := _weight("Hips", body.get("hips") != null)
	if body.get("hips") != null:
		hips = hips.interpolate_with(_placed(to_skeleton, body["hips"], lift), weight)
	_humanoid.pose_hips(skeleton, hips)
	var standing := to_skeleton.origin.y + _humanoid.ankle_height()
	for side: String in Humanoid.SIDES:
		var ankle := _humanoid.ankle_below(hips, side)
		# Below hips that are low it would hang through the floor.
		ankle.origin.y = maxf(ankle.origin.y, standing)
		weight = _weight(side, ankles.has(side))
		if ankles.has(side):
			ankle = ankle.interpolate_with(ankles[side], weight)
		_humanoid.pose_leg(skeleton, hips, side, ankle, knees.get(side, hips * Vector3.FORWARD))


## The walker's legs, in the avatar's own frame.
func _step() -> void:
	var skeleton := get_skeleton()
	var message := _fresh("pose/ik")
	var size := skeleton.global_basis.get_scale().y
	var floor_below := Vector3(_humanoid.centre.x, _humanoid.ankle_height() - ankle_height / size, _humanoid.centre.z)
	var to_skeleton := Transform3D(_humanoid.facing.scaled(Vector3.ONE / size), floor_below)
	var hips := _humanoid.hips_at_rest()
	if message != null:
		hips.origin.y += message.data["pelvis_dy"] / size
	_humanoid.pose_hips(skeleton, hips)
	for side: String in Humanoid.SIDES:
		var ankle := _humanoid.ankle_below(hips, side)
		var pole := hips * Vector3.FORWARD
		var weight := _weight(side, message != null)
		if message != null:
			var foot: Dictionary = message.data[_KEYS[side]]
			ankle = ankle.interpolate_with(_placed(to_skeleton, foot, Vector3.ZERO), weight)
			pole = to_skeleton * Frames.vector(foot["hint"])
		_humanoid.pose_leg(skeleton, hips, side, ankle, pole)


## The walker himself: turned to the heading and moved along it.
func _walk(delta: float) -> void:
	var message := _fresh("pose/ik")
	if message == null:
		return
	var heading := (_stage_in_world().basis * Frames.vector(message.data["heading"])).normalized()
	var flat := Vector3(heading.x, 0.0, heading.z)
	if flat.length_squared() < 1e-6:
		return
	var skeleton := get_skeleton()
	var size := skeleton.global_basis.get_scale()
	skeleton.global_basis = (Basis.looking_at(flat) * _humanoid.facing.inverse()).scaled_local(size)
	skeleton.global_position += heading * message.data["speed"] * delta


## The user's bones do not stretch: any message has their length.
func _scale() -> void:
	var message := _fresh("pose/body")
	if message == null:
		return
	var length := 0.0
	var legs := 0
	for key: String in _KEYS.values():
		var foot: Variant = message.data[key]
		if foot == null or foot["hip"] == null or foot["knee"] == null:
			continue
		var knee := Frames.vector(foot["knee"])
		length += knee.distance_to(Frames.vector(foot["hip"])) + knee.distance_to(Frames.vector(foot["ankle"]["p"]))
		legs += 1
	if legs == 0:
		return
	var skeleton := get_skeleton()
	var size := length / legs / _humanoid.leg_length() * _stage_in_world().basis.get_scale().y
	if length > 0.1 and absf(size / skeleton.global_basis.get_scale().y - 1.0) > 0.005:
		skeleton.global_basis = skeleton.global_basis.orthonormalized().scaled_local(Vector3.ONE * size)


func _look() -> void:
	var skeleton := get_skeleton()
	var head := skeleton.global_transform * _humanoid.head(skeleton)
	var at := head * eye_offset
	if eyes is XROrigin3D:
		# The headset moves the camera inside its origin: only where it is can be given to the avatar.
		var camera := get_viewport().get_camera_3d()
		if camera != null:
			_shift += at - camera.global_position
			eyes.global_position += at - camera.global_position
	else:
		eyes.global_transform = Transform3D(head.basis.orthonormalized(), at)


## A pose {p, q} of the wire in the skeleton's space.
func _placed(to_skeleton: Transform3D, pose: Dictionary, shift: Vector3) -> Transform3D:
	var placed := Frames.transform(pose)
	placed.origin += shift
	placed = to_skeleton * placed
	return Transform3D(placed.basis.orthonormalized(), placed.origin)


func _weight(part: String, known: bool) -> float:
	_weights[part] = move_toward(_weights[part], 1.0 if known else 0.0, _delta / RELEASE_S)
	return smoothstep(0.0, 1.0, _weights[part])


## Without what `_look` has moved it by: the avatar must not run after its own eyes.
func _stage_in_world() -> Transform3D:
	var placed := Frames.stage_in_world(stage)
	return placed.translated(-_shift) if stage != null and stage == eyes else placed
