"""Three numbers as a tuple: a pose has a dozen of them, too few for arrays on the way to an engine."""

from __future__ import annotations

import math
from collections.abc import Sequence

Vec = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

UP: Vec = (0.0, 1.0, 0.0)
SHORTEST = 1e-9
"""m: below this a vector has no direction."""


def add(a: Vec, b: Vec) -> Vec:
    """a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a: Vec, b: Vec) -> Vec:
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def along(a: Vec, direction: Vec, distance: float) -> Vec:
    """a + distance times direction."""
    return (a[0] + distance * direction[0], a[1] + distance * direction[1], a[2] + distance * direction[2])


def dot(a: Vec, b: Vec) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec, b: Vec) -> Vec:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vec) -> float:
    """Length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def unit(a: Vec, otherwise: Vec) -> Vec:
    """Direction of a; ``otherwise`` where it has none."""
    length = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    if length < SHORTEST:
        return otherwise
    return (a[0] / length, a[1] / length, a[2] / length)


def without(a: Vec, direction: Vec) -> Vec:
    """The part of a across a unit direction."""
    share = a[0] * direction[0] + a[1] * direction[1] + a[2] * direction[2]
    return (a[0] - share * direction[0], a[1] - share * direction[1], a[2] - share * direction[2])


def turned(q: Sequence[float], v: Vec) -> Vec:
    """v turned by the unit quaternion q, ``[x, y, z, w]``."""
    qx, qy, qz, qw = q
    vx, vy, vz = v
    tx, ty, tz = 2.0 * (qy * vz - qz * vy), 2.0 * (qz * vx - qx * vz), 2.0 * (qx * vy - qy * vx)
    return (
        vx + qw * tx + qy * tz - qz * ty,
        vy + qw * ty + qz * tx - qx * tz,
        vz + qw * tz + qx * ty - qy * tx,
    )
