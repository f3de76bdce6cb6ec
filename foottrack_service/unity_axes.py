"""Unity's axes and angles: left-handed, +X right, +Y up, +Z forward; so SPEC's -Z is Unity's +Z.

The way there is the way back: z changes its sign, and a mirror turns the sense of rotations about the axes within its
plane.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from foottrack_service.rotations import to_matrix

_LOCKED = 1.0 - 1e-9


def position(p: npt.ArrayLike) -> tuple[float, float, float]:
    """A point, m."""
    x, y, z = np.asarray(p, dtype=np.float64).tolist()
    return (x, y, -z)


def rotation(q: npt.ArrayLike) -> tuple[float, float, float, float]:
    """A rotation, x, y, z, w, with w not negative."""
    x, y, z, w = np.asarray(q, dtype=np.float64).tolist()
    sign = -1.0 if w < 0.0 else 1.0
    return (-x * sign, -y * sign, z * sign, w * sign)


def euler(q: npt.ArrayLike) -> tuple[float, float, float]:
    """Angles about X, Y, Z in degrees that Unity applies in the order Z, X, Y, of a rotation of ours.

    https://docs.unity3d.com/ScriptReference/Quaternion.Euler.html. Looking straight up or down, Z is 0.
    """
    m = to_matrix(rotation(q)).tolist()
    sine = -m[1][2]
    if abs(sine) >= _LOCKED:
        angles = (math.copysign(math.pi / 2.0, sine), math.atan2(-m[2][0], m[0][0]), 0.0)
    else:
        angles = (math.asin(sine), math.atan2(m[0][2], m[2][2]), math.atan2(m[1][0], m[1][1]))
    return (math.degrees(angles[0]), math.degrees(angles[1]), math.degrees(angles[2]))
