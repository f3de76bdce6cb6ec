extends RefCounted
## The lower body of a Skeleton3D with humanoid bone names (those of SkeletonProfileHumanoid, as VRM has them): what its
## rest pose says, and how it is posed. All points and frames are in the skeleton's own space.
##
## A *frame* is oriented as on the wire (+X to the model's right, +Y up, -Z where it faces), whatever its bones' axes
## and wherever the model faces (glTF and VRM: +Z).

const TwoBone := preload("two_bone.gd")
const SIDES := ["Left", "Right"]


class Leg:
	extends RefCounted
	var upper := -1
	var lower := -1
	var foot := -1
	## At rest.
	var hip: Transform3D
	var knee: Transform3D
	var ankle: Transform3D

	func thigh() -> float:
		return hip.origin.distance_to(knee.origin)

	func shank() -> float:
		return knee.origin.distance_to(ankle.origin)


## Names of bones that the skeleton lacks; when there are some, it cannot be posed.
var missing: PackedStringArray = []
## By side, "Left" and "Right".
var legs := {}
## How the model stands at rest.
var facing := Basis.IDENTITY
## Between the hip joints, at rest.
var centre := Vector3.ZERO
var _hips := -1
var _hips_rest: Transform3D
var _head := -1
var _head_rest: Transform3D


func _init(skeleton: Skeleton3D) -> void:
	_hips = _bone(skeleton, "Hips")
	for side: String in SIDES:
		var leg := Leg.new()
		leg.upper = _bone(skeleton, side + "UpperLeg")
		leg.lower = _bone(skeleton, side + "LowerLeg")
		leg.foot = _bone(skeleton, side + "Foot")
		legs[side] = leg
	if not missing.is_empty():
		return
	_hips_rest = skeleton.get_bone_global_rest(_hips)
	for side: String in SIDES:
		var leg: Leg = legs[side]
		leg.hip = skeleton.get_bone_global_rest(leg.upper)
		leg.knee = skeleton.get_bone_global_rest(leg.lower)
		leg.ankle = skeleton.get_bone_global_rest(leg.foot)
	var left: Vector3 = legs["Left"].hip.origin
	var right: Vector3 = legs["Right"].hip.origin
	centre = (left + right) / 2.0
	var across := Vector3(right.x - left.x, 0.0, right.z - left.z).normalized()
	facing = Basis(across, Vector3.UP, across.cross(Vector3.UP))
	_head = skeleton.find_bone("Head")
	if _head >= 0:
		_head_rest = skeleton.get_bone_global_rest(_head)


## Hip joint to ankle joint along the bones, mean of both legs.
func leg_length() -> float:
	var sum := 0.0
	for leg: Leg in legs.values():
		sum += leg.thigh() + leg.shank()
	return sum / 2.0


## The ankles' height at rest.
func ankle_height() -> float:
	return (legs["Left"].ankle.origin.y + legs["Right"].ankle.origin.y) / 2.0


## The frame of the hips' centre at rest.
func hips_at_rest() -> Transform3D:
	return Transform3D(facing, centre)


## The frame of the hips' centre when only feet are known, their frames by side: as high as at rest, over the middle of
## the feet, facing where they face.
func hips_over(ankles: Dictionary) -> Transform3D:
	var forward := Vector3.ZERO
	for ankle: Transform3D in ankles.values():
		forward -= Vector3(ankle.basis.z.x, 0.0, ankle.basis.z.z)
	if forward.length_squared() < 1e-6:
		return hips_at_rest()
	var basis := Basis.looking_at(forward)
	var sum := Vector3.ZERO
	for side: String in ankles:
		sum += ankles[side].origin - basis * facing.inverse() * (legs[side].hip.origin - centre)
	sum /= ankles.size()
	return Transform3D(basis, Vector3(sum.x, centre.y, sum.z))


## The frame of an ankle at rest, carried along by the hips.
func ankle_below(hips: Transform3D, side: String) -> Transform3D:
	var ankle: Vector3 = legs[side].ankle.origin
	return hips * hips_at_rest().affine_inverse() * Transform3D(facing, ankle)


## Puts the hips' centre and its frame there.
func pose_hips(skeleton: Skeleton3D, hips: Transform3D) -> void:
	skeleton.set_bone_global_pose(_hips, hips * hips_at_rest().affine_inverse() * _hips_rest)


## Brings a foot as near to `ankle` as the leg is long, its knee towards `pole`. After `pose_hips`.
func pose_leg(skeleton: Skeleton3D, hips: Transform3D, side: String, ankle: Transform3D, pole: Vector3) -> void:
	var leg: Leg = legs[side]
	var forward := -facing.z
	var hip := hips * hips_at_rest().affine_inverse() * leg.hip.origin
	var reached := TwoBone.reach(hip, ankle.origin, leg.thigh(), leg.shank())
	var bent := TwoBone.bend(hip, reached, pole, -hips.basis.z)
	var knee := TwoBone.knee(hip, reached, leg.thigh(), leg.shank(), bent)
	var rest_thigh := TwoBone.frame(leg.hip.origin, leg.knee.origin, forward)
	var rest_shank := TwoBone.frame(leg.knee.origin, leg.ankle.origin, forward)
	var thigh := TwoBone.frame(hip, knee, bent) * rest_thigh.inverse() * leg.hip.basis
	var shank := TwoBone.frame(knee, reached, bent) * rest_shank.inverse() * leg.knee.basis
	skeleton.set_bone_global_pose(leg.upper, Transform3D(thigh, hip))
	skeleton.set_bone_global_pose(leg.lower, Transform3D(shank, knee))
	skeleton.set_bone_global_pose(leg.foot, Transform3D(ankle.basis * facing.inverse() * leg.ankle.basis, reached))


## The head's frame as it is posed now, its origin at the head bone.
func head(skeleton: Skeleton3D) -> Transform3D:
	if _head < 0:
		return hips_at_rest()
	return skeleton.get_bone_global_pose(_head) * _head_rest.affine_inverse() * Transform3D(facing, _head_rest.origin)


func _bone(skeleton: Skeleton3D, name: String) -> int:
	var found := skeleton.find_bone(name)
	if found < 0:
		missing.append(name)
	return found
