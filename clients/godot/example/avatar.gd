extends Skeleton3D
## A person of boxes, with the bones of SkeletonProfileHumanoid and, like every glTF or VRM model, facing +Z.

const _BONES := [
	# name, parent, place in the parent's space
	["Hips", "", Vector3(0.0, 0.95, 0.0)],
	["Spine", "Hips", Vector3(0.0, 0.12, 0.0)],
	["Chest", "Spine", Vector3(0.0, 0.16, 0.0)],
	["Neck", "Chest", Vector3(0.0, 0.24, 0.0)],
	["Head", "Neck", Vector3(0.0, 0.1, 0.0)],
	["LeftUpperLeg", "Hips", Vector3(0.1, -0.04, 0.0)],
	["LeftLowerLeg", "LeftUpperLeg", Vector3(0.0, -0.42, 0.01)],
	["LeftFoot", "LeftLowerLeg", Vector3(0.0, -0.4, -0.02)],
	["LeftToes", "LeftFoot", Vector3(0.0, -0.06, 0.14)],
	["RightUpperLeg", "Hips", Vector3(-0.1, -0.04, 0.0)],
	["RightLowerLeg", "RightUpperLeg", Vector3(0.0, -0.42, 0.01)],
	["RightFoot", "RightLowerLeg", Vector3(0.0, -0.4, -0.02)],
	["RightToes", "RightFoot", Vector3(0.0, -0.06, 0.14)],
]
## Size of a box and where its middle is from the bone.
const _BOXES := {
	"Hips": [Vector3(0.32, 0.16, 0.2), Vector3(0.0, 0.02, 0.0)],
	"Spine": [Vector3(0.28, 0.18, 0.18), Vector3(0.0, 0.06, 0.0)],
	"Chest": [Vector3(0.38, 0.26, 0.22), Vector3(0.0, 0.12, 0.0)],
	"Head": [Vector3(0.17, 0.24, 0.2), Vector3(0.0, 0.1, 0.02)],
	"UpperLeg": [Vector3(0.14, 0.4, 0.15), Vector3(0.0, -0.21, 0.0)],
	"LowerLeg": [Vector3(0.11, 0.38, 0.12), Vector3(0.0, -0.2, 0.0)],
	"Foot": [Vector3(0.1, 0.08, 0.22), Vector3(0.0, -0.05, 0.05)],
	"Toes": [Vector3(0.1, 0.05, 0.08), Vector3(0.0, -0.005, 0.04)],
}


func _init() -> void:
	for bone: Array in _BONES:
		add_bone(bone[0])
		var index := get_bone_count() - 1
		if bone[1] != "":
			set_bone_parent(index, find_bone(bone[1]))
		set_bone_rest(index, Transform3D(Basis.IDENTITY, bone[2]))
		reset_bone_pose(index)


func _ready() -> void:
	for index in get_bone_count():
		var bone := get_bone_name(index)
		var box: Array = _BOXES.get(bone.trim_prefix("Left").trim_prefix("Right"), [])
		if box.is_empty():
			continue
		var shape := BoxMesh.new()
		shape.size = box[0]
		var material := StandardMaterial3D.new()
		material.albedo_color = Color.CORAL if bone.begins_with("Left") else Color.STEEL_BLUE
		shape.material = material
		var mesh := MeshInstance3D.new()
		mesh.mesh = shape
		mesh.position = box[1]
		var holder := BoneAttachment3D.new()
		holder.bone_name = bone
		add_child(holder)
		holder.add_child(mesh)
