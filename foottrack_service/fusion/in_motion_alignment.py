"""The attitude of a foot that starts anew in motion and does not know how it leans: what its first pictures show of it.

A wrong tilt turns the specific force into a false acceleration, which the places that are seen contradict within a
tenth of a second. But from a radian away one pass of the filter learns as much nonsense as truth, and is sure of it: so
the start is repeated with the attitude that the whole stretch shows, until that changes no more (the iterated Kalman
smoother: B. Bell, The iterated Kalman smoother as a Gauss-Newton method, 1994). The tags' own tilt, which is mirrored
now and then, is not needed.
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import turn_body
from foottrack_service.fusion.foot_filter_events import (
    GYRO,
    IMU,
    KIND,
    MEASURED_Q,
    RESET,
    TILT_SIGMA,
    TURN_SIGMA,
    WHOLE,
    YAW_SIGMA,
)
from foottrack_service.fusion.foot_filter_memory import Feet
from foottrack_service.fusion.foot_filter_optical import settle_fix
from foottrack_service.fusion.timeline import Timeline
from foottrack_service.rotations import Array

UNKNOWN_TILT = 0.2
"""rad: who starts with a tilt that is less sure is aligned ..."""
SHOWN_TILT = 0.15
"""rad: ... once the pictures have shown it so well ..."""
LONGEST_S = 0.4
"""... and for so long."""
START_SIGMA = 0.5
"""rad per axis: what the attitude is unsure by at every new try."""
SETTLED = 0.01
"""rad: what the last try may still change."""
MOST_TRIES = 4
FURTHEST = 0.15
"""m: a radian in the tilt does no more from one picture to the next. What is further off is another thing."""


class InMotionAlignment:
    """One foot's. Instants in ns."""

    def __init__(self, foot: Feet, timeline: Timeline) -> None:
        self._foot, self._timeline = foot, timeline
        self._start: int | None = None

    def begin(self, i: int) -> None:
        """The foot starts anew at event ``i``."""
        P = self._timeline.P[i]
        unknown = math.hypot(P[6, 6] ** 0.5, P[8, 8] ** 0.5) > UNKNOWN_TILT
        self._start = int(self._timeline.t[i]) if unknown else None

    def holds(self, t: int, residual: Array) -> bool:
        """Whether a fix of ``t``, off by ``residual``, m, shape (3,), belongs to a start still being aligned."""
        if self._start is None or not 0 <= t - self._start <= LONGEST_S * 1e9:
            return False
        return float(np.linalg.norm(residual)) < FURTHEST

    def refine(self) -> None:
        """Another fix was taken: start again with the attitude that all of them show."""
        if self._start is None:
            return
        timeline = self._timeline
        for _ in range(MOST_TRIES):
            i = self._event()
            last = timeline.n - 1
            P = timeline.P[last]
            if i is None or math.hypot(P[6, 6] ** 0.5, P[8, 8] ** 0.5) > SHOWN_TILT:
                return
            start = timeline.X[i, 6:10].copy()
            carried = _carried(self._foot, i, start)
            turn = rot.multiply(timeline.X[last, 6:10], rot.conjugate(carried))
            row = timeline.rows[i]
            row[MEASURED_Q : MEASURED_Q + 4] = rot.normalised(rot.multiply(turn, start))
            row[TURN_SIGMA] = WHOLE
            row[TILT_SIGMA] = row[YAW_SIGMA] = START_SIGMA
            settle_fix(self._foot, i, False, False)
            if float(np.linalg.norm(rot.to_rotation_vector(turn))) < SETTLED:
                return

    def _event(self) -> int | None:
        timeline = self._timeline
        rows, t = timeline.rows[: timeline.n], timeline.t[: timeline.n]
        found = np.flatnonzero((rows[:, KIND] == RESET) & (t == self._start))
        return int(found[-1]) if len(found) and found[-1] > 0 else None


@compiled
def _carried(foot: Feet, i: int, q: Array) -> Array:
    """The attitude q, shape (4,), of event ``i`` carried by the gyro alone to the newest event."""
    s = foot[0]
    found = q.copy()
    x = s.X[s.n - 1]
    before = -1
    for j in range(i, s.n):
        if s.rows[j, KIND] == IMU:
            dt = (s.t[j] - s.t[i if before < 0 else before]) * 1e-9
            w = np.empty(3)
            for k in range(3):
                earlier = s.rows[j if before < 0 else before, GYRO + k]
                w[k] = 0.5 * (earlier + s.rows[j, GYRO + k]) - x[13 + k]
            turn_body(found, w[0] * dt, w[1] * dt, w[2] * dt)
            before = j
    return found
