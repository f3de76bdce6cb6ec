"""A ring of checkpoints: late measurements are applied where they belong, and what came after is replayed.

One continuous block of memory keeps the last events in the order of their stamps, with the state and covariance after
each. When it is full the newer half moves to the front, so compiled code always sees plain ascending rows.
Method: commaai/rednose's checkpoints; T. D. Larsen et al., Incorporation of time delayed measurements, 1998.
"""

from __future__ import annotations

from foottrack_service.compiled import compiled
from foottrack_service.fusion.foot_filter_events import COLUMNS, Stamps
from foottrack_service.fusion.foot_filter_kernel import NE, NX
from foottrack_service.fusion.foot_filter_memory import KEPT, Feet, Foot
from foottrack_service.rotations import Array


@compiled
def place(s: Foot, t: int) -> int:
    """Make room for an event at ``t``, ns, behind all with the same or an earlier stamp; what is behind moves up.

    Returns its index, its row is zero; 0 when ``t`` is before everything that is kept, and then nothing has changed.
    """
    i: int = s.n
    while i > 0 and s.t[i - 1] > t:
        i -= 1
    full = s.n == 2 * KEPT
    if s.n > 0 and i <= (KEPT if full else 0):
        return 0
    if full:
        for j in range(KEPT):
            s.t[j] = s.t[KEPT + j]
            for k in range(COLUMNS):
                s.rows[j, k] = s.rows[KEPT + j, k]
            for k in range(NX):
                s.X[j, k] = s.X[KEPT + j, k]
            for k in range(NE):
                for m in range(NE):
                    s.P[j, k, m] = s.P[KEPT + j, k, m]
        s.n = KEPT
        i -= KEPT
    for j in range(s.n, i, -1):
        s.t[j] = s.t[j - 1]
        for k in range(COLUMNS):
            s.rows[j, k] = s.rows[j - 1, k]
    s.t[i] = t
    for k in range(COLUMNS):
        s.rows[i, k] = 0.0
    s.n += 1
    return i


class Timeline:
    """Events 0 .. ``n`` - 1 with their stamps, rows, states and covariances, in a foot's memory."""

    def __init__(self, foot: Feet) -> None:
        self._foot = foot
        self.t: Stamps = foot["t"][0]
        self.rows: Array = foot["rows"][0]
        self.X: Array = foot["X"][0]
        self.P: Array = foot["P"][0]

    @property
    def n(self) -> int:
        """How many events there are."""
        return int(self._foot["n"][0])

    def place(self, t: int) -> int:
        """``place`` for Python."""
        return int(_place(self._foot, t))

    def restart(self, t: int) -> int:
        """Forget all events but the newest state, which now stands at ``t``, ns; returns its index, 0."""
        last = self.n - 1
        self.X[0], self.P[0], self.rows[0] = self.X[last].copy(), self.P[last].copy(), self.rows[last].copy()
        self.t[0] = t
        self._foot["n"] = 1
        return 0


@compiled
def _place(foot: Feet, t: int) -> int:
    return place(foot[0], t)
