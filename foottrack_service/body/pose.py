"""The lower body of one instant, from the head and the fused feet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.body.legs import hip_joint, hips_below_head, knee, lowered_to_reach
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.rotations import Array

_FORWARD = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, slots=True)
class Legs:
    """Hips (centre m, rotation) and, for each side that has a foot, hip joint and knee, m."""

    hips_p: Array
    hips_q: Array
    joints: dict[str, Array]
    knees: dict[str, Array]


def solve_legs(head_p: Array, head_q: Array, ankles: dict[str, Array], skeleton: Skeleton) -> Legs:
    """Legs between a head and the ankles (m, stage) that are known. Knees bend to where the hips face."""
    hips_p, hips_q = hips_below_head(head_p, head_q, skeleton)
    joints = [hip_joint(hips_p, hips_q, side, skeleton) for side in ankles]
    lowered = lowered_to_reach(hips_p, joints, list(ankles.values()), skeleton)
    shift = lowered - hips_p
    forward = rot.rotate(hips_q, _FORWARD)
    at = {side: joint + shift for side, joint in zip(ankles, joints, strict=True)}
    knees = {side: knee(at[side], ankle, forward, skeleton) for side, ankle in ankles.items()}
    return Legs(lowered, hips_q, at, knees)
