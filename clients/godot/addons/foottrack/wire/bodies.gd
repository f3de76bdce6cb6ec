extends RefCounted
## The streams of the wire, version 1, and what their bodies are (SPEC, sections 5 and 6).

const C := preload("checks.gd")


class Stream:
	extends RefCounted
	var body: C.Check
	## Whether a reader that falls behind should forget all but the newest.
	var latest: bool

	func _init(what: C.Check, newest_only := false) -> void:
		body = what
		latest = newest_only


static var _number := C.Number.new()
static var _not_negative := C.Number.new(0.0)
static var _integer := C.Integer.new()
static var _count := C.Integer.new(0)
static var _bool := C.OfType.new(TYPE_BOOL)
static var _str := C.OfType.new(TYPE_STRING)
static var _vector := C.Floats.new(3)
static var _quaternion := C.Floats.new(4, C.Shape.UNIT)
static var _side := C.OneOf.new(["left", "right"])
static var _counts := C.MapOf.new(_count)
static var _pose := C.Fields.new({"p": _vector, "q": _quaternion})

static var _imu := C.Fields.new({
	"acc": _vector,
	"gyro": C.nilable(_vector),
	"q": C.nilable(_quaternion),
	"t_dev": C.nilable(_integer),
	"t_arr": _integer,
	"accuracy": C.nilable(C.Integer.new(0, 3)),
}, func(imu: Dictionary) -> bool: return imu.gyro != null or imu.q != null)

static var _optical := C.Fields.new({
	"p": _vector,
	"q": C.nilable(_quaternion),
	"q_alt": C.nilable(_quaternion),
	"cov": C.Floats.new(6, C.Shape.COVARIANCE),
	"size_ratio": C.nilable(_not_negative),
	"reproj_px": C.nilable(_not_negative),
	"edge_px": _number,
	"frame": _integer,
})

static var _head := C.Fields.new({
	"p": C.nilable(_vector),
	"q": C.nilable(_quaternion),
	"tracked": _bool,
	"origin": C.nil_or(0, _integer),
	"moved": C.nilable(_pose),
}, func(head: Dictionary) -> bool: return not head.tracked or (head.p != null and head.q != null))

static var _calibration := C.ByKind.new({
	"floor": _calibrated("floor", {"height": _number}),
	"heading": _calibrated("heading", {
		"yaw": _number,
		"imu_yaw": C.absent_or({"left": null, "right": null}, C.Fields.new({
			"left": C.nilable(_number),
			"right": C.nilable(_number),
		})),
	}),
	"body": _calibrated("body", {
		"height": _not_negative,
		"thigh": _not_negative,
		"shank": _not_negative,
		"torso": _not_negative,
		"hip_width": _not_negative,
		"hip_back": _number,
		"neck_down": C.nilable(_not_negative),
		"neck_back": C.nilable(_number),
	}),
	"mount": _calibrated("mount", {
		"p": _vector,
		"q": _quaternion,
		"sigma_p": _not_negative,
		"sigma_q": _not_negative,
		"base": _str,
	}),
	"imu": _calibrated("imu", {
		"side": _side,
		"acc_bias": _vector,
		"gyro_bias": _vector,
		"p": _vector,
		"q": _quaternion,
	}),
})

static var _foot_pose := C.Fields.new({
	"hip": C.nilable(_vector),
	"knee": C.nilable(_vector),
	"ankle": _pose,
	"toe": _vector,
	"v": _vector,
	"contact": _bool,
	"stage": C.OneOf.new(["marker", "depth", "inertial", "coasting", "lost"]),
	"sigma": _not_negative,
	"age": C.nilable(_not_negative),
})

static var _body_pose := C.Fields.new({
	"head": C.nilable(_pose),
	"hips": C.nilable(_pose),
	"left": C.nilable(_foot_pose),
	"right": C.nilable(_foot_pose),
})

static var _ik_foot := C.Fields.new({"p": _vector, "q": _quaternion, "hint": _vector})

static var _ik_targets := C.Fields.new({
	"mode": C.OneOf.new(["stand", "walk"]),
	"left": _ik_foot,
	"right": _ik_foot,
	"pelvis_dy": C.Number.new(-INF, 0.0),
	"speed": _number,
	"heading": C.Floats.new(3, C.Shape.UNIT),
})

static var _foot_gait := C.Fields.new({
	"phase": C.OneOf.new(["stance", "ascending", "mid_swing", "descending", "terminal_swing"]),
	"height": _number,
	"vy": _number,
})

static var _gait_state := C.Fields.new({
	"left": C.nilable(_foot_gait),
	"right": C.nilable(_foot_gait),
	"cadence": _not_negative,
	"speed": _number,
	"steps": _count,
})

static var _gait_event := C.Fields.new({
	"side": C.nilable(_side),
	"event": C.OneOf.new(
		["heel_off", "toe_off", "mid_swing", "terminal_swing", "foot_strike", "first_step", "stop"]
	),
	"step": _count,
}, func(event: Dictionary) -> bool: return event.side != null or event.event in ["first_step", "stop"])

static var _session := C.Fields.new({
	"session": _str,
	"protocol": C.Fields.new({"major": _count, "minor": _count}),
	"clock": C.Fields.new({"bus": _integer, "unix": _integer}),
	"users": C.ListOf.new(C.Matching.new("\\A[a-z0-9][a-z0-9-]{0,31}\\z")),
	"config_hash": _str,
})

static var _health := C.Fields.new({
	"topics": C.absent_or({}, C.MapOf.new(C.Fields.new({
		"hz": _not_negative,
		"messages": _count,
		"gaps": _count,
		"drops": C.absent_or({}, _counts),
		"age": C.nilable(_not_negative),
	}))),
	"filters": C.absent_or({}, C.MapOf.new(C.Fields.new({
		"accepted": C.absent_or({}, _counts),
		"rejected": C.absent_or({}, _counts),
	}))),
	"nodes": C.absent_or({}, C.MapOf.new(C.Fields.new({
		"state": C.OneOf.new(["starting", "running", "restarting", "failed", "stopped"]),
		"restarts": C.absent_or(0, _count),
		"error": C.nilable(_str),
	}))),
	"drops": C.absent_or({}, _counts),
	"latency_ms": C.nilable(C.Fields.new({"p50": _not_negative, "p99": _not_negative})),
})

static var _log := C.Fields.new({
	"level": C.OneOf.new(["warning", "error", "critical"]),
	"logger": _str,
	"message": _str,
})

## The answer to `time`.
static var time := C.Fields.new({"t": _integer})

## Streams of a user, by name without the user.
static var of_user := {
	"imu/left": Stream.new(_imu),
	"imu/right": Stream.new(_imu),
	"marker/left": Stream.new(_optical),
	"marker/right": Stream.new(_optical),
	"depth/left": Stream.new(_optical),
	"depth/right": Stream.new(_optical),
	"head/pose": Stream.new(_head),
	"truth/left": Stream.new(_pose),
	"truth/right": Stream.new(_pose),
	"calibration": Stream.new(_calibration),
	"camera/preview": Stream.new(C.Fields.new({"jpeg": C.OfType.new(TYPE_PACKED_BYTE_ARRAY)}), true),
	"pose/body": Stream.new(_body_pose, true),
	"pose/ik": Stream.new(_ik_targets, true),
	"gait/state": Stream.new(_gait_state, true),
	"gait/event": Stream.new(_gait_event),
}

## Streams of the service, by name without `sys/`.
static var of_system := {
	"session": Stream.new(_session),
	"health": Stream.new(_health),
	"log": Stream.new(_log),
}


static func _calibrated(kind: String, values: Dictionary) -> C.Check:
	return C.Fields.new({"kind": C.OneOf.new([kind]), "values": C.Fields.new(values)})
