"""Two-bone legs: the knee in the triangle of thigh and shank, bent about the knee's own axis.

In plain floats, as it runs for every pose on its way to an engine.
"""

from __future__ import annotations

import math

from foottrack_service.body.skeleton import Skeleton
from foottrack_service.body.vectors import SHORTEST, Quaternion, Vec, cross, dot, norm, sub, turned, unit, without

FOOT_SHARE = 0.35
"""How much the foot turns the knee's axis out of the pelvis's: 0.2 to 0.5 are alike on motion capture."""

_RIGHT: Vec = (1.0, 0.0, 0.0)


def knee_axis(pelvis_right: Vec, pelvis_forward: Vec, foot_q: Quaternion | None) -> Vec:
    """The axis (unit, level, to the right) about which a knee bends, between the pelvis's and the foot's lateral axes.

    A foot's forward axis flips when it points down at push-off; its lateral axis does not. It counts the less, the
    further it is turned out, and not at all when it points the other way: no foot can turn a knee round.
    """
    if foot_q is None:
        return pelvis_right
    x, _, z = turned(foot_q, _RIGHT)
    share = FOOT_SHARE * max(0.0, x * pelvis_right[0] + z * pelvis_right[2])
    rest = 1.0 - FOOT_SHARE
    return unit((rest * pelvis_right[0] + share * x, 0.0, rest * pelvis_right[2] + share * z), pelvis_right)


def knee(hip: Vec, ankle: Vec, axis: Vec, forward: Vec, body: Skeleton) -> Vec:
    """The knee between hip and ankle, m, bent forwards about ``axis`` (unit, level, to the right).

    Thigh and shank keep their lengths wherever a leg can reach the ankle. Beyond that the leg is straight and the thigh
    keeps its length: what is missing is missing at the ankle, which is where the foot was measured. ``forward`` (unit)
    is where the knee goes when the leg lies along the axis.
    """
    thigh, shank = body.thigh, body.shank
    leg = sub(ankle, hip)
    length = norm(leg)
    if length < SHORTEST:
        return (hip[0] + forward[0] * thigh, hip[1] + forward[1] * thigh, hip[2] + forward[2] * thigh)
    ux, uy, uz = down = (leg[0] / length, leg[1] / length, leg[2] / length)
    sx, sy, sz = bend_direction(down, axis, forward)
    reached = min(max(length, abs(thigh - shank)), thigh + shank)
    ahead = (thigh * thigh - shank * shank + reached * reached) / (2.0 * reached)
    out = math.sqrt(max(0.0, thigh * thigh - ahead * ahead))
    return (hip[0] + ux * ahead + sx * out, hip[1] + uy * ahead + sy * out, hip[2] + uz * ahead + sz * out)


def bend_direction(leg: Vec, axis: Vec, forward: Vec) -> Vec:
    """Where the knee of a leg that points along ``leg`` (unit, hip to ankle) goes: unit, across the leg."""
    across = cross(axis, leg)
    if dot(across, across) > 1e-12:
        return unit(across, forward)
    return unit(without(forward, leg), (0.0, 1.0, 0.0))
