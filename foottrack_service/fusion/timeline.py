"""A ring of checkpoints: late measurements are applied where they belong, and what came after is replayed.

One continuous block of memory keeps the last events in the order of their stamps, with the state and covariance after
each. When it is full the newer half moves to the front, so compiled code always sees plain ascending rows.
Method: commaai/rednose's checkpoints; T. D. Larsen et al., Incorporation of time delayed measurements, 1998.
"""

from __future__ import annotations

import numpy as np

from foottrack_service.fusion.foot_filter_events import COLUMNS, Stamps
from foottrack_service.fusion.foot_filter_kernel import NE, NX
from foottrack_service.rotations import Array

KEPT = 640
"""Events that are surely kept: 1 s at 400 Hz with two fixes per picture at 60 fps, and some."""


class Timeline:
    """Events 0 .. ``n`` - 1 with their stamps, rows, states and covariances."""

    def __init__(self) -> None:
        self.n = 0
        self.t: Stamps = np.zeros(2 * KEPT, dtype=np.int64)
        self.rows: Array = np.zeros((2 * KEPT, COLUMNS))
        self.X: Array = np.zeros((2 * KEPT, NX))
        self.P: Array = np.zeros((2 * KEPT, NE, NE))

    def place(self, t: int) -> int:
        """``append`` or ``insert``, as the stamp wants it; 0 when ``t`` is before everything that is kept."""
        return self.append(t) if self.n == 0 or t >= self.t[self.n - 1] else self.insert(t)

    def append(self, t: int) -> int:
        """Make room for an event at ``t``, ns, not before the last one; returns its index, its row is zero."""
        if self.n == 2 * KEPT:
            for ring in (self.t, self.rows, self.X, self.P):
                ring[:KEPT] = ring[KEPT:]
            self.n = KEPT
        i = self.n
        self.t[i] = t
        self.rows[i] = 0.0
        self.n += 1
        return i

    def insert(self, t: int) -> int:
        """Make room for a late event behind all with the same or an earlier stamp; what is behind moves up.

        Returns the index, 0 when ``t`` is before everything that is kept: then nothing has changed.
        """
        place = int(np.searchsorted(self.t[: self.n], t, side="right"))
        if place == 0:
            return 0
        shift = KEPT if self.n == 2 * KEPT else 0
        if place - shift <= 0:
            return 0
        last = self.append(t)
        place -= shift
        self.t[place + 1 : last + 1] = self.t[place:last].copy()
        self.rows[place + 1 : last + 1] = self.rows[place:last].copy()
        self.t[place] = t
        self.rows[place] = 0.0
        return place

    def restart(self, t: int) -> int:
        """Forget all events but the newest state, which now stands at ``t``, ns; returns its index, 0."""
        last = self.n - 1
        self.X[0], self.P[0], self.rows[0] = self.X[last].copy(), self.P[last].copy(), self.rows[last].copy()
        self.t[0] = t
        self.n = 1
        return 0
