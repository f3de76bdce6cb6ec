class_name FoottrackFrames
extends RefCounted
## Values of the wire as the engine's own. The axes are the same (SPEC, section 4): right-handed, +Y up, -Z forward,
## metres; only the precision is the engine's.


## Of [x, y, z].
static func vector(numbers: PackedFloat64Array) -> Vector3:
	return Vector3(numbers[0], numbers[1], numbers[2])


## Of [x, y, z, w].
static func quaternion(numbers: PackedFloat64Array) -> Quaternion:
	return Quaternion(numbers[0], numbers[1], numbers[2], numbers[3]).normalized()


## Of {p, q}: body to parent.
static func transform(pose: Dictionary) -> Transform3D:
	return Transform3D(Basis(quaternion(pose["q"])), vector(pose["p"]))


## The stage in the world: an XROrigin3D with its world scale, another node, or the world itself for null.
static func stage_in_world(stage: Node3D) -> Transform3D:
	if stage == null:
		return Transform3D.IDENTITY
	var placed := stage.global_transform
	return placed.scaled_local(Vector3.ONE * stage.world_scale) if stage is XROrigin3D else placed


## {p, q} of a body in its parent. A scale in it is lost.
static func pose(of: Transform3D) -> Dictionary:
	var q := of.basis.get_rotation_quaternion()
	return {
		"p": PackedFloat64Array([of.origin.x, of.origin.y, of.origin.z]),
		"q": PackedFloat64Array([q.x, q.y, q.z, q.w]),
	}
