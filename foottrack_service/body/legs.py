"""Legs from head and feet: hips below the head, knees by the plane triangle of thigh and shank."""

from __future__ import annotations

import math

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.rotations import Array

REACH = 0.99
"""A leg is never straighter than this share of its length, so that a knee always has a direction to bend to."""


def hips_below_head(head_p: Array, head_q: Array, skeleton: Skeleton) -> tuple[Array, Array]:
    """Centre [m] and rotation (upright) of the hips of a person who stands straight under the head."""
    q = rot.twist_about_up(head_q)
    return head_p + rot.rotate(q, np.array([0.0, -skeleton.torso, skeleton.hip_back])), q


def hip_joint(hips_p: Array, hips_q: Array, side: str, skeleton: Skeleton) -> Array:
    """Centre of one hip joint, m."""
    half = 0.5 * skeleton.hip_width
    return hips_p + rot.rotate(hips_q, np.array([half if side == "right" else -half, 0.0, 0.0]))


def lowered_to_reach(hips_p: Array, joints: list[Array], ankles: list[Array], skeleton: Skeleton) -> Array:
    """The hips moved towards the feet until both legs reach, m. Shape (3,)."""
    reach = REACH * (skeleton.thigh + skeleton.shank)
    moved = np.zeros(3)
    # Each pull shortens one leg; a few rounds satisfy both whenever the feet are no wider apart than the legs allow.
    for _ in range(4):
        done = True
        for joint, ankle in zip(joints, ankles, strict=True):
            leg = joint + moved - ankle
            length = math.sqrt(float(leg @ leg))
            if length > reach:
                moved = moved - leg * (1.0 - reach / length)
                done = False
        if done:
            break
    return hips_p + moved


def knee(hip: Array, ankle: Array, pole: Array, skeleton: Skeleton) -> Array:
    """The knee between hip and ankle that bends towards ``pole`` (a direction), m. All of shape (3,).

    Thigh and shank keep their lengths where the ankle is within reach; else the knee is on the straight line.
    """
    leg = ankle - hip
    length = math.sqrt(float(leg @ leg))
    if length < 1e-9:
        return hip + pole * skeleton.thigh
    along = leg / length
    side = pole - along * float(pole @ along)
    norm = math.sqrt(float(side @ side))
    if norm < 1e-9:
        side, norm = np.array([0.0, along[2], -along[1]]), math.hypot(along[1], along[2])
    thigh, shank = skeleton.thigh, skeleton.shank
    reached = min(max(length, abs(thigh - shank)), thigh + shank)
    forward = (thigh * thigh - shank * shank + reached * reached) / (2.0 * reached) if reached > 0.0 else 0.0
    out = math.sqrt(max(0.0, thigh * thigh - forward * forward))
    return hip + along * forward + side * (out / norm)
