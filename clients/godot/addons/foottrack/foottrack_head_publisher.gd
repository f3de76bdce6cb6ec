@icon("icon.svg")
class_name FoottrackHeadPublisher
extends Node
## Tells the service where the headset is, each frame: `head/pose`. Without it the service knows feet, but no hips.

const Client := preload("foottrack_client.gd")
const Frames := preload("foottrack_frames.gd")

@export var client: Client
## The XRCamera3D; any other camera counts as tracked, for a desktop.
@export var camera: Node3D
## The XROrigin3D; the world if there is none.
@export var stage: Node3D
## The camera's pose is predicted for so much later than `_process`, s.
@export var lead := 0.0

## Changes whenever the stage was recentred.
var origin := 0
var _interface: XRInterface


func _ready() -> void:
	# After the XR camera was moved for this frame.
	process_priority = 100
	_interface = XRServer.primary_interface
	if _interface != null and _interface.has_signal("pose_recentered"):
		_interface.connect("pose_recentered", recentred)


func _process(_delta: float) -> void:
	if client == null or camera == null:
		return
	var t_usec := Time.get_ticks_usec() + int(lead * 1e6)
	var body := {"p": null, "q": null, "tracked": is_tracked(), "origin": origin}
	if body["tracked"]:
		body.merge(Frames.pose(Frames.stage_in_world(stage).affine_inverse() * camera.global_transform), true)
	client.publish("head/pose", t_usec, body)


## To be called by a game that moves the stage by itself, such as by `XRServer.center_on_hmd`.
func recentred() -> void:
	origin += 1


## Whether the headset knows where it is.
func is_tracked() -> bool:
	if not camera is XRCamera3D:
		return true
	var tracker := XRServer.get_tracker(&"head") as XRPositionalTracker
	var pose := tracker.get_pose(&"default") if tracker != null else null
	return pose != null and pose.has_tracking_data and pose.tracking_confidence != XRPose.XR_TRACKING_CONFIDENCE_NONE
