"""What a walk is judged by: slip, penetration, joint angles, closure; all of joint rotations, by forward kinematics.

Slip is the diameter, in the floor plane, of the world positions that a planted point takes over its contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.normative import PELVIC_TILT_DEG
from foottrack_service.walkcycle.skeleton import INDEX, SIDES, Humanoid, forward_kinematics
from foottrack_service.walkcycle.walk import Contact, Motion

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FootPoints:
    """World positions (n, 3) m of one foot's points, and its yaw (n,) rad."""

    ankle: Array
    heel: Array
    ball: Array
    toe_tip: Array
    yaw: Array
    lowest: Array


@dataclass(frozen=True)
class Slip:
    """Greatest over all contacts: `point_mm` of heel and ball, `yaw_deg` while both are down; `penetration_mm` of
    the floor over the whole motion; `contacts` counted."""

    point_mm: float
    yaw_deg: float
    penetration_mm: float
    contacts: int


def foot_points(body: Humanoid, motion: Motion) -> dict[str, FootPoints]:
    """Both feet of a motion."""
    positions, world = forward_kinematics(body.offsets, motion.hips, motion.rotations)
    found = {}
    for side in SIDES:
        foot, toes = INDEX[f"{side}Foot"], INDEX[f"{side}Toes"]
        ankle, ball = positions[:, foot], positions[:, toes]
        heel = ankle + rot.rotate(world[:, foot], body.heel)
        tip = ball + rot.rotate(world[:, toes], body.toe_tip)
        sole = ball[:, 1] - body.ball_height
        across = ball - heel
        yaw = np.unwrap(np.arctan2(across[:, 0], across[:, 2]))
        lowest = np.minimum(np.minimum(heel[:, 1], tip[:, 1]), sole)
        found[side] = FootPoints(ankle, heel, ball, tip, yaw, lowest)
    return found


def measure_slip(body: Humanoid, motion: Motion, contacts: list[Contact]) -> Slip:
    """Slip of a motion against the contacts it is meant to have."""
    points = foot_points(body, motion)
    point = yaw = 0.0
    counted = 0
    for contact in contacts:
        foot = points[contact.side]
        planted = []
        for name, interval in (("heel", contact.heel), ("ball", contact.ball)):
            if interval is None:
                continue
            during = (motion.times >= interval[0]) & (motion.times <= interval[1])
            planted.append(during)
            if np.count_nonzero(during) > 1:
                counted += 1
                point = max(point, _diameter(getattr(foot, name)[during][:, [0, 2]]))
        if len(planted) == 2:
            both = planted[0] & planted[1]
            if np.count_nonzero(both) > 1:
                yaw = max(yaw, float(np.ptp(foot.yaw[both])))
    deepest = max(0.0, *(-float(np.min(foot.lowest)) for foot in points.values()))
    return Slip(1e3 * point, float(np.degrees(yaw)), 1e3 * deepest, counted)


def denser(motion: Motion, factor: int = 4) -> Motion:
    """What a viewer shows between the keys: places linearly, rotations by slerp, `factor` times as dense."""
    n = len(motion.times)
    index = np.arange((n - 1) * factor + 1)
    low = np.minimum(index // factor, n - 2)
    share = index / factor - low
    times = motion.times[low] + share * (motion.times[low + 1] - motion.times[low])
    hips = motion.hips[low] + share[:, None] * (motion.hips[low + 1] - motion.hips[low])
    joints = rot.slerp(
        motion.rotations[low],
        motion.rotations[low + 1],
        np.broadcast_to(share[:, None], (len(index), motion.rotations.shape[1])),
    )
    return Motion(times, hips, joints)


def joint_angles(motion: Motion, side: str) -> dict[str, Array]:
    """Sagittal angles (n,) in degrees, as gait analysis gives them: hip flexion (with the pelvic tilt that published
    curves hold), knee flexion, ankle dorsiflexion."""
    ahead = [0.0, 0.0, 1.0]
    upper = rot.rotate(motion.rotations[:, INDEX[f"{side}UpperLeg"]], [0.0, -1.0, 0.0])
    lower = rot.rotate(motion.rotations[:, INDEX[f"{side}LowerLeg"]], [0.0, -1.0, 0.0])
    foot = rot.rotate(motion.rotations[:, INDEX[f"{side}Foot"]], ahead)
    return {
        "hip": np.degrees(np.arctan2(upper[:, 2], -upper[:, 1])) + PELVIC_TILT_DEG,
        "knee": np.degrees(np.arctan2(-lower[:, 2], -lower[:, 1])),
        "ankle": np.degrees(np.arctan2(foot[:, 1], foot[:, 2])),
    }


def _diameter(points: Array) -> float:
    """Greatest distance between any two of points (n, 2)."""
    if len(points) > 400:
        # The two ends of the widest extents in many directions: exact to 1e-5 of the diameter.
        angles = np.linspace(0.0, np.pi, 400, endpoint=False)
        along = points @ np.stack([np.cos(angles), np.sin(angles)])
        return float(np.max(np.ptp(along, axis=0)))
    return float(np.max(np.linalg.norm(points[:, None] - points[None], axis=-1)))
