"""Rotations of thighs and shanks, which the wire leaves to the points of the joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foottrack_protocol.messages import FootPose, Pose
from foottrack_service.body.legs import knee_axis
from foottrack_service.body.skeleton import BALL_SHARE
from foottrack_service.rotations import Array, from_matrix, from_yaw, rotate, yaw_of

_SHORTEST = 1e-6


class Leg(NamedTuple):
    """Joints [m] and rotations of a leg whose joints are known, stage frame. All rotations are those of a person who
    stands at ease when the leg hangs down."""

    hip: Array
    knee: Array
    ankle: Array
    toes: Array
    thigh_q: Array
    shank_q: Array
    foot_q: Array


def leg(hips: Pose | None, foot: FootPose | None) -> Leg | None:
    """None where a joint is not known, or the foot is lost."""
    if hips is None or foot is None or foot.stage == "lost" or foot.hip is None or foot.knee is None:
        return None
    hip, knee, ankle = (np.asarray(point) for point in (foot.hip, foot.knee, foot.ankle.p))
    heading = from_yaw(yaw_of(hips.q))
    right, forward = (tuple(rotate(heading, axis).tolist()) for axis in ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0]))
    axis = np.asarray(knee_axis(right, forward, foot.ankle.q))
    return Leg(
        hip,
        knee,
        ankle,
        ankle + BALL_SHARE * (np.asarray(foot.toe) - ankle),
        _hanging(hip, knee, axis),
        _hanging(knee, ankle, axis),
        np.asarray(foot.ankle.q),
    )


def _hanging(upper: Array, lower: Array, axis: Sequence[float] | Array) -> Array:
    """The rotation of a bone that hangs from ``upper`` to ``lower`` and whose +X is as near to ``axis`` as can be."""
    up = upper - lower
    length = float(np.linalg.norm(up))
    up = up / length if length > _SHORTEST else np.array([0.0, 1.0, 0.0])
    right = np.asarray(axis) - np.dot(axis, up) * up
    size = float(np.linalg.norm(right))
    if size < _SHORTEST:
        right, size = np.cross(up, [0.0, 0.0, 1.0]), 1.0
    right = right / size
    return from_matrix(np.column_stack([right, up, np.cross(right, up)]))
