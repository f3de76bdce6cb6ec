"""Legs that reach: the height the pelvis may have, and two-bone inverse kinematics with a hinge for a knee."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.curves import soft_minimum
from foottrack_service.walkcycle.errors import ReachError
from foottrack_service.walkcycle.skeleton import INDEX, SIDES, Humanoid

Array = npt.NDArray[np.float64]

REACH = 0.999
"""Longest leg as a share of thigh and shank: 5 degrees at the knee. Straighter, the knee snaps."""
MOST_LOWERED = 0.15
"""A pelvis that had to sink by more than this share of the leg says that the feet are out of reach."""
_KNEE_YAW_FROM_FOOT = 0.35
"""Share of the foot's yaw against the pelvis' in the knee's direction (0.2 to 0.5 fits motion capture best)."""
_SOFT_M = 0.005


def reachable_height(
    body: Humanoid, hips: Array, hips_rotation: Array, ankles: dict[str, Array], place: Array | None = None
) -> Array:
    """Heights (n,) m of the pelvis at which both legs reach, never above those asked for.

    `hips` (n, 3), `hips_rotation` (n, 4), `ankles` per side (n, 3), all in the world. Raises ReachError, which
    names the first instant (`place`, e.g. phases), when the pelvis would sink too far.
    """
    limits = []
    longest = REACH * body.leg
    for side in SIDES:
        hip_joint = rot.rotate(hips_rotation, body.offsets[INDEX[f"{side}UpperLeg"]])
        away = ankles[side] - hips - hip_joint
        level = np.hypot(away[:, 0], away[:, 2])
        rise = np.sqrt(np.maximum(longest**2 - level**2, 0.0))
        limit = ankles[side][:, 1] + rise - hip_joint[:, 1]
        bad = (level >= longest) | (hips[:, 1] - limit > MOST_LOWERED * body.leg)
        if np.any(bad):
            at = int(np.argmax(bad))
            where = f" at {float(place[at]):.2f} cycles" if place is not None else ""
            raise ReachError(
                f"the {side} foot is out of the leg's reach{where}: {np.hypot(level[at], away[at, 1]):.3f} m from the"
                f" hip, and the leg is {body.leg:.3f} m long"
            )
        limits.append(limit)
    width = _SOFT_M * body.scale
    return soft_minimum(hips[:, 1], soft_minimum(limits[0], limits[1], width), width)


def close_leg(
    body: Humanoid, side: str, hips: Array, hips_rotation: Array, ankle: Array, foot: Array, foot_yaw: Array
) -> tuple[Array, Array, Array]:
    """Local rotations (n, 4) of upper leg, lower leg and foot that put the ankle exactly where it belongs.

    World `hips` (n, 3), `hips_rotation` (n, 4), `ankle` (n, 3), `foot` (n, 4); `foot_yaw` (n,) rad is the foot's
    heading, which must not be taken from a pitched foot: it flips at push-off.
    """
    thigh, shank = body.thigh, body.shank
    hip = hips + rot.rotate(hips_rotation, body.offsets[INDEX[f"{side}UpperLeg"]])
    leg = ankle - hip
    length = np.linalg.norm(leg, axis=-1)
    reach = np.clip(length, 1e-6, thigh + shank)
    down = leg / np.maximum(length, 1e-9)[:, None]
    facing = rot.rotate(hips_rotation, [0.0, 0.0, 1.0])
    pelvis_yaw = np.arctan2(facing[:, 0], facing[:, 2])
    turn = np.mod(foot_yaw - pelvis_yaw + np.pi, 2.0 * np.pi) - np.pi
    yaw = pelvis_yaw + _KNEE_YAW_FROM_FOOT * turn
    pole = np.stack([np.sin(yaw), np.zeros_like(yaw), np.cos(yaw)], axis=-1)
    hinge = np.cross(-down, pole)
    hinge /= np.linalg.norm(hinge, axis=-1, keepdims=True)
    ahead = np.cross(hinge, -down)
    cosine = np.clip((thigh**2 + reach**2 - shank**2) / (2.0 * thigh * reach), -1.0, 1.0)
    sine = np.sqrt(1.0 - cosine**2)
    thigh_way = cosine[:, None] * down + sine[:, None] * ahead
    shank_way = (leg - thigh * thigh_way) / shank
    shank_way /= np.linalg.norm(shank_way, axis=-1, keepdims=True)
    upper, lower = _bone(hinge, thigh_way), _bone(hinge, shank_way)
    return (
        rot.multiply(rot.conjugate(hips_rotation), upper),
        rot.multiply(rot.conjugate(upper), lower),
        rot.multiply(rot.conjugate(lower), foot),
    )


def _bone(hinge: Array, way: Array) -> Array:
    """World rotation of a bone that points along `way` (rest: -Y) and bends about `hinge` (rest: +X)."""
    return rot.from_matrix(np.stack([hinge, -way, np.cross(hinge, -way)], axis=-1))
