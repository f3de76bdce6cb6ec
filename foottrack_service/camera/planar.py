"""The two poses of a flat target, and which of them gravity allows.

Four coplanar corners of a small tag fit two attitudes almost equally well (Collins and Bartoli, IPPE, 2014): the tag
leans towards the camera or away from it. The picture alone cannot tell; what knows which way is up can. Pure numpy,
so that fusion decides with the same lines that the camera's tests use.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations
from foottrack_service.rotations import Array


def choose_by_up(
    q: npt.ArrayLike, q_alt: npt.ArrayLike | None, up_in_parent: npt.ArrayLike, up_in_tag: npt.ArrayLike
) -> Array:
    """Of two attitudes (4,), tag to parent, the one whose up agrees better, (4,).

    `up_in_parent` (3,) is up in the frame the attitudes lead to, `up_in_tag` (3,) is where the tag's own up points
    (from an IMU on the same shoe, or what it was when the shoe stood); neither has to be of unit length.
    Without an alternative it is `q`. Raises ValueError when an up is zero or not finite.
    """
    if q_alt is None:
        return np.asarray(q, dtype=np.float64)
    both = np.stack([np.asarray(q, dtype=np.float64), np.asarray(q_alt, dtype=np.float64)])
    agreement = rotations.rotate(both, _unit(up_in_tag)) @ _unit(up_in_parent)
    return np.asarray(both[int(np.argmax(agreement))])


def choose_by_attitude(q: npt.ArrayLike, q_alt: npt.ArrayLike | None, expected: npt.ArrayLike) -> Array:
    """Of two attitudes (4,) the one nearer to an expected one, (4,): its last known one, or an IMU's prediction."""
    if q_alt is None or rotations.angle_between(q, expected) <= rotations.angle_between(q_alt, expected):
        return np.asarray(q, dtype=np.float64)
    return np.asarray(q_alt, dtype=np.float64)


def _unit(direction: npt.ArrayLike) -> Array:
    v = np.asarray(direction, dtype=np.float64)
    norm = float(np.linalg.norm(v))
    if not np.isfinite(norm) or norm == 0.0:
        raise ValueError("up is zero or not finite")
    return v / norm
