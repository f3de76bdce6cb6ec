"""Legs from head and feet: hips below the head, knees in the plane triangle of thigh and shank.

In plain floats: it runs for every pose on its way to an engine, and three numbers are too few for arrays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from foottrack_protocol.messages import Side
from foottrack_service.body.skeleton import Skeleton

Vec = tuple[float, float, float]

REACH = 0.99
"""A leg is never straighter than this share of its length, so that a knee always has a direction to bend to."""
_ROUNDS = 8


@dataclass(frozen=True, slots=True)
class Legs:
    """Hips (centre m, rotation to the stage, upright), and hip joint and knee [m] of each foot that there is."""

    hips: Vec
    hips_q: tuple[float, float, float, float]
    joints: dict[Side, Vec]
    knees: dict[Side, Vec]


def solve_legs(head_p: Sequence[float], head_q: Sequence[float], ankles: Mapping[Side, Vec], body: Skeleton) -> Legs:
    """Legs of a person who stands below the head (m, stage; q head to stage) on these ankles (m, stage).

    The hips face where the head faces, and come down or across until both feet are within reach. Knees bend forwards.
    """
    qy, qw = head_q[1], head_q[3]
    norm = math.hypot(qy, qw)
    qy, qw = (qy / norm, qw / norm) if norm > 1e-9 else (0.0, 1.0)
    sine, cosine = 2.0 * qy * qw, qw * qw - qy * qy
    back, half = body.hip_back, 0.5 * body.hip_width
    hips = (head_p[0] + back * sine, head_p[1] - body.torso, head_p[2] + back * cosine)
    offsets: dict[Side, Vec] = {
        side: (half * cosine, 0.0, -half * sine) if side == "right" else (-half * cosine, 0.0, half * sine)
        for side in ankles
    }
    hips = _within_reach(hips, offsets, ankles, REACH * (body.thigh + body.shank))
    joints = {side: _add(hips, offset) for side, offset in offsets.items()}
    forward = (-sine, 0.0, -cosine)
    knees = {side: knee(joints[side], ankle, forward, body) for side, ankle in ankles.items()}
    return Legs(hips, (0.0, qy, 0.0, qw), joints, knees)


def knee(hip: Vec, ankle: Vec, pole: Vec, body: Skeleton) -> Vec:
    """The knee between hip and ankle, m, that bends towards the direction ``pole``.

    Thigh and shank keep their lengths where the ankle is within reach; else the knee is on the straight line.
    """
    thigh, shank = body.thigh, body.shank
    lx, ly, lz = ankle[0] - hip[0], ankle[1] - hip[1], ankle[2] - hip[2]
    length = math.sqrt(lx * lx + ly * ly + lz * lz)
    if length < 1e-9:
        return (hip[0] + pole[0] * thigh, hip[1] + pole[1] * thigh, hip[2] + pole[2] * thigh)
    ux, uy, uz = lx / length, ly / length, lz / length
    along = pole[0] * ux + pole[1] * uy + pole[2] * uz
    sx, sy, sz = pole[0] - along * ux, pole[1] - along * uy, pole[2] - along * uz
    norm = math.sqrt(sx * sx + sy * sy + sz * sz)
    if norm < 1e-9:  # the leg points where the knee should: bend upwards, or backwards if it is upright
        sx, sy, sz = (-uy * ux, 1.0 - uy * uy, -uy * uz) if abs(uy) < 0.9 else (0.0, -uz, uy)
        norm = math.sqrt(sx * sx + sy * sy + sz * sz)
    reached = min(max(length, abs(thigh - shank)), thigh + shank)
    ahead = (thigh * thigh - shank * shank + reached * reached) / (2.0 * reached)
    out = math.sqrt(max(0.0, thigh * thigh - ahead * ahead)) / norm
    return (hip[0] + ux * ahead + sx * out, hip[1] + uy * ahead + sy * out, hip[2] + uz * ahead + sz * out)


def _within_reach(hips: Vec, offsets: Mapping[Side, Vec], ankles: Mapping[Side, Vec], reach: float) -> Vec:
    # Each pull shortens one leg to its reach; a few rounds satisfy both unless the feet are too far apart for it.
    for _ in range(_ROUNDS):
        moved = False
        for side, ankle in ankles.items():
            leg = _add(hips, offsets[side])
            dx, dy, dz = ankle[0] - leg[0], ankle[1] - leg[1], ankle[2] - leg[2]
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            if length > reach:
                pull = 1.0 - reach / length
                hips = (hips[0] + dx * pull, hips[1] + dy * pull, hips[2] + dz * pull)
                moved = True
        if not moved:
            break
    return hips


def _add(a: Vec, b: Vec) -> Vec:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])
