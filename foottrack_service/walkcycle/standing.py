"""How the body stands before and after a walk: upright, knees a little soft, arms at the sides."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.skeleton import POSED_JOINTS, Humanoid

Array = npt.NDArray[np.float64]

_SOFT_KNEES_M = 0.001
_ARM_DOWN = np.radians(77.0)
_ELBOW = np.radians(10.0)


def arm_rotations(side: str, swing: float, elbow: float, abduction: float = 0.0) -> dict[str, Array]:
    """Upper and lower arm from the T-pose to hanging: `swing` forward, `elbow` bent, `abduction` away from the body
    (rad)."""
    sign = 1.0 if side == "left" else -1.0
    down = rot.from_axis_angle([0.0, 0.0, 1.0], np.array(-sign * (_ARM_DOWN - abduction)))
    forward = rot.from_axis_angle([1.0, 0.0, 0.0], np.array(-swing))
    bend = rot.from_axis_angle([0.0, 1.0, 0.0], np.array(-sign * elbow))
    return {f"{side}UpperArm": rot.multiply(forward, down), f"{side}LowerArm": bend}


def standing_pose(body: Humanoid) -> tuple[Array, dict[str, Array]]:
    """Pelvis (3,) m about its guide and rotations (4,) of the posed joints."""
    hips = np.array([0.0, body.ankle_height + body.leg - _SOFT_KNEES_M * body.scale, 0.0])
    joints = dict.fromkeys(POSED_JOINTS, rot.IDENTITY)
    for side in ("left", "right"):
        joints.update(arm_rotations(side, 0.0, _ELBOW))
    return hips, joints
