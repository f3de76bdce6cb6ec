"""Where things were while the shutter was open.

The head's and the feet's poses are functions of time; over one picture (some 20 ms) they are sampled at a few knots
and interpolated between them, so that a picture costs the simulation nine poses however finely it is blurred.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from foottrack_service import rotations
from foottrack_service.rotations import Array

PoseTrack = Callable[[Array], tuple[Array, Array]]
"""Times (n,), s, to positions (n, 3), m, and rotations (n, 4), body to stage."""

_KNOTS = 9


def still(p: tuple[float, float, float], q: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)) -> PoseTrack:
    """The track of what does not move."""
    place, turn = np.array(p), rotations.normalised(q)
    return lambda t: (np.broadcast_to(place, (len(t), 3)), np.broadcast_to(turn, (len(t), 4)))


def moving(
    p: tuple[float, float, float], v: tuple[float, float, float], q: tuple[float, float, float, float]
) -> PoseTrack:
    """The track of what passes `p` at t = 0 with velocity `v`, m/s, and does not turn."""
    place, speed, turn = np.array(p), np.array(v), rotations.normalised(q)
    return lambda t: (place + np.outer(t, speed), np.broadcast_to(turn, (len(t), 4)))


@dataclass(frozen=True)
class Poses:
    """A pose track over one picture, sampled at equidistant knots from `start` on, `step` s apart."""

    start: float
    step: float
    p: Array
    R: Array

    @classmethod
    def sample(cls, track: PoseTrack, start: float, end: float) -> Poses:
        """The track between two times, s."""
        times = np.linspace(start, max(end, start + 1e-6), _KNOTS)
        p, q = track(times)
        return cls(start, float(times[1] - times[0]), np.asarray(p), rotations.to_matrix(q))

    def one(self, t: float) -> tuple[Array, Array]:
        """Position (3,) and rotation matrix (3, 3) at one time, s."""
        p, R = self.at(np.array([t]))
        return p[0], R[0]

    def at(self, t: Array) -> tuple[Array, Array]:
        """Positions (..., 3) and rotation matrices (..., 3, 3) at times (...), s, inside the span."""
        place = np.clip((t - self.start) / self.step, 0.0, _KNOTS - 1 - 1e-9)
        index = place.astype(np.int64)
        share = place - index
        p = self.p[index] + share[..., None] * (self.p[index + 1] - self.p[index])
        # Chords of a matrix between knots 3 ms apart are off a rotation by less than 1e-4 even at 20 rad/s.
        R = self.R[index] + share[..., None, None] * (self.R[index + 1] - self.R[index])
        return p, R
