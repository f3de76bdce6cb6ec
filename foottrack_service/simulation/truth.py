"""What really happened: head, hips and feet as smooth functions of time.

A track is sampled at `GRID_HZ` and joined by quintic splines, so position and attitude have four continuous
derivatives, and velocity, acceleration and angular rate are the exact derivatives of what the pose says. Anything that
can be sampled (a footstep plan, a walk cycle, motion capture) can become the truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.rotations import Array

GRID_HZ = 500.0
"""Sampling of a track before it is splined: 12 samples over the shortest impact (24 ms)."""
MARGIN_S = 0.5
"""Tracks reach so far beyond both ends, for sensors that look a little before the start."""

BOTH: tuple[Side, Side] = ("left", "right")

Flags = npt.NDArray[np.bool_]


class Kinematics(NamedTuple):
    """A body's motion at times (n,)."""

    p: Array
    """(n, 3) m, stage."""
    q: Array
    """(n, 4) body to stage."""
    v: Array
    """(n, 3) m/s, stage."""
    a: Array
    """(n, 3) m/s^2, stage, without gravity."""
    w: Array
    """(n, 3) angular rate, rad/s, body frame."""
    dw: Array
    """(n, 3) angular acceleration, rad/s^2, body frame."""


def grid(seconds: float) -> Array:
    """The instants, s, at which a track of this length is sampled, margins included."""
    count = round((seconds + 2.0 * MARGIN_S) * GRID_HZ) + 1
    return np.arange(count) / GRID_HZ - MARGIN_S


class Track:
    """A rigid body's motion: `t` (n,) s rising, `p` (n, 3) m and `q` (n, 4) body to stage at these times."""

    def __init__(self, t: Array, p: Array, q: Array) -> None:
        self._span = (float(t[0]), float(t[-1]))
        self._p = make_interp_spline(t, p, k=5)
        self._q = make_interp_spline(t, rotations.continuous(q), k=5)
        self._v, self._a = self._p.derivative(1), self._p.derivative(2)
        self._dq, self._ddq = self._q.derivative(1), self._q.derivative(2)

    def pose(self, t: Array) -> tuple[Array, Array]:
        """Positions (n, 3), m, and rotations (n, 4), body to stage, at times (n,), s."""
        t = np.clip(t, *self._span)
        return self._p(t), rotations.normalised(self._q(t))

    def velocity(self, t: Array) -> Array:
        """(n, 3) m/s, stage."""
        v: Array = self._v(np.clip(t, *self._span))
        return v

    def kinematics(self, t: Array) -> Kinematics:
        """Everything at times (n,), s."""
        t = np.clip(t, *self._span)
        s, ds, dds = self._q(t), self._dq(t), self._ddq(t)
        # The spline's quaternion s is not unit; with n = |s|: w = 2 vec(s* s') / n^2, and its derivative in body axes.
        squared = np.sum(s * s, axis=-1, keepdims=True)
        inverse = rotations.conjugate(s)
        w = 2.0 * rotations.multiply(inverse, ds)[..., :3] / squared
        shrink = 2.0 * np.sum(s * ds, axis=-1, keepdims=True) / squared
        dw = 2.0 * rotations.multiply(inverse, dds)[..., :3] / squared - shrink * w
        return Kinematics(self._p(t), s / np.sqrt(squared), self._v(t), self._a(t), w, dw)

    def point(self, t: Array, r: npt.ArrayLike) -> Array:
        """Where the body's point `r` (3,), m, is in the stage, (n, 3)."""
        p, q = self.pose(t)
        return p + rotations.rotate(q, r)


class FootTrack(Track):
    """A foot: the ankle's motion, and when heel and forefoot stand.

    The foot is rigid. `heel_point` and `ball_point`, (3,) m in its frame, touch the floor while it stands flat; after
    the strike it turns about the heel, and with its heel up it rolls from the ball to the toes' tip.
    """

    def __init__(
        self,
        t: Array,
        p: Array,
        q: Array,
        *,
        heel: Flags,
        toe: Flags,
        heel_point: Array,
        ball_point: Array,
        strikes: Array | None = None,
    ) -> None:
        super().__init__(t, p, q)
        self._t, self._heel, self._toe = t, heel, toe
        self.heel_point, self.ball_point = heel_point, ball_point
        self.strikes = np.empty(0) if strikes is None else strikes
        """Instants of foot strike, s."""

    def contact(self, t: Array) -> tuple[Flags, Flags]:
        """Whether the heel and whether the forefoot stands, each (n,)."""
        index = np.clip(np.searchsorted(self._t, t, side="right") - 1, 0, len(self._t) - 1)
        return self._heel[index], self._toe[index]


@dataclass(frozen=True)
class Truth:
    """A whole scene, stage frame. `hips` is None where no person wears the sensors (the technical bench)."""

    seconds: float
    head: Track
    feet: Mapping[Side, FootTrack]
    hips: Track | None = None

    @property
    def left(self) -> FootTrack:
        """The left foot."""
        return self.feet["left"]

    @property
    def right(self) -> FootTrack:
        """The right foot."""
        return self.feet["right"]
