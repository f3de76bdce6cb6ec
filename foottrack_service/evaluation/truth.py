"""True tracks of a foot, interpolated at the instants of estimates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from foottrack_service import rotations as rot
from foottrack_service.rotations import Array

Flags = npt.NDArray[np.bool_]

LONGEST_GAP_S = 0.05
"""Truth samples further apart are a hole: nothing is compared within it."""


class TruthTrack:
    """A foot's ankle in the stage as a reference system saw it.

    Positions go through a cubic spline: linear interpolation of 100 Hz truth would add 0.6 mm of its own at 50 m/s^2.
    """

    def __init__(self, t: Sequence[int], p: Sequence[Sequence[float]], q: Sequence[Sequence[float]]) -> None:
        """Stamps in ns, positions (n, 3) in m, rotations (n, 4). Repeated and reversed stamps are left out.

        Raises ValueError with fewer than four usable samples.
        """
        stamps = np.asarray(t, dtype=np.int64)
        order = np.argsort(stamps, kind="stable")
        keep = order[np.concatenate([[True], np.diff(stamps[order]) > 0])] if len(order) else order
        if len(keep) < 4:
            raise ValueError(f"{len(keep)} samples of truth are too few to compare with")
        self.t = stamps[keep]
        self._q = rot.continuous(np.asarray(q, dtype=np.float64)[keep])
        self._zero = int(self.t[0])
        self._seconds = (self.t - self._zero) * 1e-9
        self._p = CubicSpline(self._seconds, np.asarray(p, dtype=np.float64)[keep])

    def covers(self, t: Array) -> Flags:
        """For each instant (ns), whether truth brackets it closely. Shape (n,)."""
        t = np.asarray(t)
        after = np.clip(np.searchsorted(self.t, t), 1, len(self.t) - 1)
        close = (self.t[after] - self.t[after - 1]) * 1e-9 <= LONGEST_GAP_S
        return np.asarray((t >= self.t[0]) & (t <= self.t[-1]) & close)

    def position(self, t: Array) -> Array:
        """Ankle at instants (ns), m, shape (n, 3)."""
        return np.asarray(self._p((np.asarray(t) - self._zero) * 1e-9))

    def velocity(self, t: Array) -> Array:
        """m/s, shape (n, 3)."""
        return np.asarray(self._p((np.asarray(t) - self._zero) * 1e-9, 1))

    def rotation(self, t: Array) -> Array:
        """Foot to stage, shape (n, 4)."""
        seconds = (np.asarray(t) - self._zero) * 1e-9
        after = np.clip(np.searchsorted(self._seconds, seconds), 1, len(self._seconds) - 1)
        before = after - 1
        share = (seconds - self._seconds[before]) / (self._seconds[after] - self._seconds[before])
        return rot.slerp(self._q[before], self._q[after], np.clip(share, 0.0, 1.0))
