"""Whether a head is still: the gate of every calibration."""

from __future__ import annotations

from collections import deque

import numpy as np

from foottrack_protocol.frames import MAX_HEAD_GAP_S
from foottrack_service.rotations import Array

STILL_S = 0.6
"""A head is still when over so long it keeps within STILL_SD."""
STILL_SD = 0.003
"""m: standard deviation of the position, of its worst axis."""
KEPT_S = 5.0
_LEAST = 10
"""Poses in the window."""


class StillHead:
    """Follows a head. Stamps in ns, positions (3,) m, rotations (4,) head to stage."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, Array, Array]] = deque()
        self._since: int | None = None
        self.sd: float | None = None
        """m over the last STILL_S; None while less is known."""

    def add(self, t: int, p: Array, q: Array) -> None:
        """A tracked pose. After a hole, or when stamps go back, it begins anew."""
        if self._poses and not 0 < t - self._poses[-1][0] <= MAX_HEAD_GAP_S * 1e9:
            self.reset()
        self._poses.append((t, p, q))
        while t - self._poses[0][0] > KEPT_S * 1e9:
            self._poses.popleft()
        begin = t - round(STILL_S * 1e9)
        window = [place for stamp, place, _ in self._poses if stamp >= begin]
        if len(window) < _LEAST or self._poses[0][0] > begin:
            self.sd = None
            return
        self.sd = float(np.std(window, axis=0).max())
        if self.sd >= STILL_SD:
            self._since = None
        elif self._since is None:
            self._since = begin

    def reset(self) -> None:
        """Nothing is known of it any more."""
        self._poses.clear()
        self._since = self.sd = None

    @property
    def since(self) -> int | None:
        """Since when it has been still, ns; None when it moves."""
        return self._since

    @property
    def still_s(self) -> float:
        """For how long it has been still, s."""
        return 0.0 if self._since is None else (self._poses[-1][0] - self._since) * 1e-9

    def poses(self, seconds: float) -> tuple[Array, Array]:
        """Positions (n, 3) and rotations (n, 4) of the last seconds."""
        begin = self._poses[-1][0] - round(seconds * 1e9)
        kept = [(p, q) for t, p, q in self._poses if t >= begin]
        return np.array([p for p, _ in kept]), np.array([q for _, q in kept])

    @property
    def problem(self) -> str:
        """Why it is not still, as a person would say it."""
        if self.sd is None:
            return "the head was not seen long enough"
        return f"the head moved ({1000.0 * self.sd:.0f} mm, below {1000.0 * STILL_SD:.0f} counts as still)"
