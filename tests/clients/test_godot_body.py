"""FoottrackBody on a real Skeleton3D: feet where the user's feet are, whatever the model's size and facing."""

from __future__ import annotations

import itertools
import json
import math
from typing import Any

import numpy as np
import pytest
from client_traffic import UPRIGHT, foot, frames
from godot_project import GodotProject

from foottrack_protocol.messages import BodyPose, FootPose, IkFoot, IkTargets, Pose
from foottrack_service import rotations

pytestmark = pytest.mark.engine
TRACKED, WALK_IN_PLACE = 0, 1
TOLERANCE_M = 1e-4
THIGH_M, SHANK_M = 0.441, 0.4205
AVATAR_LEG_M = math.hypot(0.42, 0.01) + math.hypot(0.4, 0.02)
AVATAR_ANKLE_M = 0.95 - 0.04 - 0.42 - 0.4
USER_ANKLE_M = 0.09


def pose_avatar(godot: GodotProject, stream: str, body: Any, **settings: Any) -> dict[str, Any]:
    """What the avatar's bones say after a second of one message."""
    hexes = [part.hex() for part in frames(stream, body)]
    said: dict[str, Any] = godot.run("body.gd", json.dumps({"follow": TRACKED, "frames": hexes, **settings}))
    return said


def at(said: dict[str, Any], bone: str) -> np.ndarray[Any, Any]:
    return np.array(said[bone]["p"])


def same_rotation(q: Any, other: Any) -> bool:
    return bool(abs(abs(np.dot(q, other)) - 1.0) < 1e-5)


def leg(hips: Pose, x: float, ankle: Pose, **changes: Any) -> FootPose:
    """A leg as long as THIGH_M and SHANK_M, its knee forward of the hips."""
    hip = np.array(hips.p) + rotations.rotate(hips.q, (x, 0.0, 0.0))
    way = np.array(ankle.p) - hip
    distance = float(np.linalg.norm(way))
    forward = rotations.rotate(hips.q, (0.0, 0.0, -1.0))
    bent = forward - way * (forward @ way) / distance**2
    along = (THIGH_M**2 - SHANK_M**2 + distance**2) / (2 * distance)
    knee = hip + way / distance * along + bent / np.linalg.norm(bent) * math.sqrt(THIGH_M**2 - along**2)
    return foot(x, hip=tuple(hip), knee=tuple(knee), ankle=ankle, **changes)


def lifted_step() -> BodyPose:
    """The left foot in the air, pitched and turned; the hips turned to the left."""
    yaw = rotations.from_yaw(math.radians(20))
    hips = Pose(p=(0.0, 0.87, 0.0), q=tuple(yaw))
    pitched = rotations.multiply(yaw, rotations.from_axis_angle((1.0, 0.0, 0.0), -0.4))
    left = leg(hips, -0.1, Pose(p=(-0.1, 0.25, 0.1), q=tuple(pitched)), contact=False)
    return BodyPose(hips=hips, left=left, right=leg(hips, 0.1, Pose(p=(0.1, USER_ANKLE_M, 0.0), q=UPRIGHT)))


@pytest.mark.parametrize("turned", [0.0, 2.1], ids=["facing +Z", "turned"])
def test_feet_and_knees_are_where_the_user_s_are(godot: GodotProject, turned: float) -> None:
    body = lifted_step()
    assert body.left is not None and body.right is not None and body.hips is not None
    said = pose_avatar(godot, "pose/body", body, turned=turned)
    assert said["scale"] == pytest.approx((THIGH_M + SHANK_M) / AVATAR_LEG_M, abs=1e-5)
    # The soles are on the floor with the avatar's own ankles, which the user's would be above or below of.
    lift = np.array([0.0, AVATAR_ANKLE_M * said["scale"] - USER_ANKLE_M, 0.0])
    for side, user in (("Left", body.left), ("Right", body.right)):
        assert at(said, f"{side}Foot") == pytest.approx(np.array(user.ankle.p) + lift, abs=TOLERANCE_M)
        assert same_rotation(said[f"{side}Foot"]["q"], user.ankle.q)
        # The avatar's thigh and shank are in nearly the same proportion, and its hips a little narrower or wider.
        assert np.linalg.norm(at(said, f"{side}LowerLeg") - (np.array(user.knee) + lift)) < 0.005
        bones = [f"{side}UpperLeg", f"{side}LowerLeg", f"{side}Foot"]
        lengths = [np.linalg.norm(at(said, a) - at(said, b)) for a, b in itertools.pairwise(bones)]
        assert lengths == pytest.approx(
            [said["scale"] * math.hypot(0.42, 0.01), said["scale"] * math.hypot(0.4, 0.02)], abs=TOLERANCE_M
        )
    joints = (at(said, "LeftUpperLeg") + at(said, "RightUpperLeg")) / 2
    assert joints == pytest.approx(np.array(body.hips.p) + lift, abs=TOLERANCE_M)
    assert same_rotation(said["Hips"]["q"], body.hips.q)
    # Left is left: no model walks backwards or crossed.
    assert at(said, "LeftUpperLeg")[0] < at(said, "RightUpperLeg")[0]


def test_a_foot_out_of_reach_stretches_the_leg_and_not_the_bones(godot: GodotProject) -> None:
    far = BodyPose(hips=Pose(p=(0.0, 0.9, 0.0), q=UPRIGHT), left=foot(-0.1, 0.09, -3.0), right=foot(0.1))
    said = pose_avatar(godot, "pose/body", far)
    reach = np.linalg.norm(at(said, "LeftFoot") - at(said, "LeftUpperLeg"))
    assert reach == pytest.approx(0.999 * AVATAR_LEG_M * said["scale"], rel=1e-4)
    assert at(said, "LeftFoot")[2] < -0.5


@pytest.mark.parametrize(("age", "ahead"), [(0.05, 0.05), (0.3, 0.1)], ids=["to the frame", "no further than 0.1 s"])
def test_a_moving_foot_is_carried_to_the_frame(godot: GodotProject, age: float, ahead: float) -> None:
    hips = Pose(p=(0.0, 0.8, 0.0), q=UPRIGHT)
    ankle = Pose(p=(-0.1, 0.15, 0.0), q=UPRIGHT)
    left = leg(hips, -0.1, ankle, v=(0.2, 0.0, -2.0), contact=False)
    body = BodyPose(hips=hips, left=left, right=leg(hips, 0.1, Pose(p=(0.1, USER_ANKLE_M, 0.0), q=UPRIGHT)))
    said = pose_avatar(godot, "pose/body", body, age=age)
    lift = AVATAR_ANKLE_M * said["scale"] - USER_ANKLE_M
    due = [-0.1 + 0.2 * ahead, 0.15 + lift, -2.0 * ahead]
    assert at(said, "LeftFoot") == pytest.approx(due, abs=TOLERANCE_M)


def test_a_pose_of_long_ago_is_none(godot: GodotProject) -> None:
    said = pose_avatar(godot, "pose/body", lifted_step(), age=0.6)
    assert at(said, "LeftFoot")[1] == pytest.approx(AVATAR_ANKLE_M, abs=1e-3)


def test_the_headset_s_eyes_are_put_into_the_avatar_s_and_the_feet_stay(godot: GodotProject) -> None:
    # More frames do not carry the avatar away after its own eyes.
    near, far = (pose_avatar(godot, "pose/body", lifted_step(), eyes="origin", updates=count) for count in (60, 90))
    body = lifted_step()
    assert body.right is not None
    for said in (near, far):
        lift = np.array([0.0, AVATAR_ANKLE_M * said["scale"] - USER_ANKLE_M, 0.0])
        assert at(said, "RightFoot") == pytest.approx(np.array(body.right.ankle.p) + lift, abs=TOLERANCE_M)
        assert 1.3 < said["eyes"]["camera"][1] < 1.9
    assert near["eyes"]["camera"] == pytest.approx(far["eyes"]["camera"], abs=TOLERANCE_M)


@pytest.mark.parametrize("unknown", ["nil", "lost", "not valid"])
def test_what_is_not_known_hangs_at_rest(godot: GodotProject, unknown: str) -> None:
    lifted = foot(-0.1, ankle_y=0.4)
    left = {"nil": None, "lost": lifted.model_copy(update={"stage": "lost"}), "not valid": lifted}[unknown]
    body = BodyPose(left=left, right=foot(0.1))
    hexes = [part.hex() for part in frames("pose/body", body, valid=unknown != "not valid")]
    said = godot.run("body.gd", json.dumps({"follow": TRACKED, "frames": hexes}))
    assert at(said, "LeftFoot")[1] == pytest.approx(AVATAR_ANKLE_M * said["scale"], abs=1e-3)
    # The other foot is where it is, and the hips, which are not known either, are over the feet and face as they do.
    if unknown != "not valid":
        assert at(said, "RightFoot") == pytest.approx([0.1, AVATAR_ANKLE_M * said["scale"], 0.0], abs=2e-3)
        assert same_rotation(said["Hips"]["q"], UPRIGHT)
        assert at(said, "LeftFoot")[0] < 0.0


def test_a_foot_that_is_lost_does_not_hang_through_the_floor(godot: GodotProject) -> None:
    hips = Pose(p=(0.0, 0.55, 0.0), q=UPRIGHT)
    right = leg(hips, 0.1, Pose(p=(0.1, USER_ANKLE_M, 0.0), q=UPRIGHT))
    left = leg(hips, -0.1, Pose(p=(-0.1, USER_ANKLE_M, 0.0), q=UPRIGHT), stage="lost")
    said = pose_avatar(godot, "pose/body", BodyPose(hips=hips, left=left, right=right))
    standing = AVATAR_ANKLE_M * said["scale"]
    assert at(said, "Hips")[1] < 0.7
    assert [at(said, f"{side}Foot")[1] for side in ("Left", "Right")] == pytest.approx([standing] * 2, abs=2e-3)


def test_the_walker_walks_along_his_heading_with_planted_feet_on_the_floor(godot: GodotProject) -> None:
    heading = (-1.0, 0.0, 0.0)
    targets = IkTargets(
        mode="walk",
        left=IkFoot(p=(-0.1, USER_ANKLE_M, -0.2), q=UPRIGHT, hint=(-0.1, 0.5, -0.6)),
        right=IkFoot(p=(0.1, 0.19, 0.1), q=UPRIGHT, hint=(0.1, 0.5, -0.3)),
        pelvis_dy=-0.05,
        speed=1.2,
        heading=heading,
    )
    said = pose_avatar(godot, "pose/ik", targets, follow=WALK_IN_PLACE, eyes="camera")
    place = np.array(said["place"])
    assert place[0] < -0.05 and place[1:] == pytest.approx([0.0, 0.0], abs=1e-5)
    # Turned to -X: the avatar's right is -Z, its forward -X.
    left = at(said, "LeftFoot") - place
    assert left == pytest.approx([-0.2, AVATAR_ANKLE_M, 0.1], abs=TOLERANCE_M)
    right = at(said, "RightFoot") - place
    assert right == pytest.approx([0.1, AVATAR_ANKLE_M + 0.1, -0.1], abs=TOLERANCE_M)
    assert at(said, "Hips")[1] == pytest.approx(0.95 - 0.05, abs=TOLERANCE_M)
    assert said["eyes"]["forward"] == pytest.approx(heading, abs=1e-5)
    assert said["eyes"]["p"][0] < place[0] - 0.05
