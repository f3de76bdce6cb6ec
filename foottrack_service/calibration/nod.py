"""Where the head nods about: the point that its turns leave still."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.body.facing import head_yaw
from foottrack_service.body.skeleton import EYES_ABOVE_NECK, EYES_BEFORE_NECK
from foottrack_service.rotations import Array

LEAST_NOD = math.radians(25.0)
"""Less shows no pivot beside a body that sways."""
MOST_ASIDE = math.radians(25.0)
"""Of the look while nodding: more, and the body turned too."""
MOST_SPREAD = 0.012
"""m RMS that the pivot may move: more, and the body went somewhere."""
MOST_OFF = 0.05
"""m: how far it may be, down or back, from where people have it."""
_PEOPLE = 0.025
"""m: by how much people differ, standard deviation."""
_SWAY, _SWAY_S = 0.006, 0.6
"""m, s: by how much a standing body sways, and after how long it is somewhere else."""


class Neck(NamedTuple):
    """The pivot from the eyes of a level head, m, positive both."""

    down: float
    back: float


def neck_of(t: Array, p: Array, q: Array) -> Neck | None:
    """The pivot of a nod: stamps (n,) s, places (n, 3) m and turns (n, 4) of a head that looked down and up again.

    p + R (0, -down, back) = c, by least squares with what is known of people as a prior. None when the head hardly
    nodded, turned aside, or went somewhere, and when what comes out is nobody's neck.
    """
    if len(t) < 10:
        return None
    looks = nods_of(q)
    yaws = np.array([head_yaw(each) for each in q])
    aside = np.abs(np.remainder(yaws - yaws[0] + math.pi, 2.0 * math.pi) - math.pi)
    if np.ptp(looks) < LEAST_NOD or np.max(aside) > MOST_ASIDE:
        return None
    down, back = rot.rotate(q, [0.0, -1.0, 0.0]), rot.rotate(q, [0.0, 0.0, 1.0])
    # Without their means, which are c's; samples that sway together count as one.
    a = np.stack([(each - each.mean(axis=0)).ravel() for each in (down, back)], axis=-1)
    b = -(p - p.mean(axis=0)).ravel()
    weight = max((t[-1] - t[0]) / _SWAY_S, 1.0) / len(t) / _SWAY**2
    usual = np.array([EYES_ABOVE_NECK, EYES_BEFORE_NECK])
    found = np.linalg.solve(weight * a.T @ a + np.eye(2) / _PEOPLE**2, weight * a.T @ b + usual / _PEOPLE**2)
    spread = float(np.sqrt(np.sum((a @ found - b) ** 2) / len(t)))
    if spread > MOST_SPREAD or np.max(np.abs(found - usual)) > MOST_OFF:
        return None
    return Neck(float(found[0]), float(found[1]))


def nods_of(q: Array) -> Array:
    """How far heads (n, 4) look up, rad, (n,)."""
    return np.asarray(np.arcsin(np.clip(rot.rotate(q, [0.0, 0.0, -1.0])[..., 1], -1.0, 1.0)))
