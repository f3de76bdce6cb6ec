"""Where the head was: what an optical fix, seen from the head, is composed with.

The pose is interpolated at the picture's own instant. The newest one instead makes 35 mm of error while the head
moves (A. Bayer, Foot Tracking in Virtual Reality, TU Wien 2021).
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np

from foottrack_service.fusion.interface import HeadSample
from foottrack_service.rotations import Array, multiply, normalised, rotate, slerp

MAX_SPAN_S = 0.1
"""Tracked poses further apart are a hole, and nothing is made up within it."""
HORIZON_S = 1.5
"""What is kept: more than any camera is late."""
SET_BACK_S = 0.03
"""A pose that is so much older than the newest, though it arrives after it, shows that the clock was set back."""


class HeadHistory:
    """The last poses of a head, in the order of their stamps: one or two may arrive out of turn.

    Poses of a clock that was set back replace those that it had stamped later: among each other, a head that walks
    would be in two places in turn.
    """

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._samples: list[HeadSample | None] = []

    def add(self, sample: HeadSample) -> None:
        """Take a tracked pose. One of the same stamp is replaced; one that is not finite is left out."""
        if np.isfinite(sample.p).all() and np.isfinite(sample.q).all() and np.any(sample.q != 0.0):
            self._insert(sample.t, HeadSample(sample.t, sample.p, normalised(sample.q)))

    def add_untracked(self, t: int) -> None:
        """The headset said at ``t``, ns, that it does not know where it is: a hole."""
        self._insert(t, None)

    def at(self, t: int) -> HeadSample | None:
        """The pose at ``t``, ns, between its two neighbours; None in a hole, before the first or after the last."""
        after = bisect_left(self._stamps, t)
        if after == len(self._stamps):
            return None
        b = self._samples[after]
        if b is None or self._stamps[after] == t:
            return b
        a = self._samples[after - 1] if after > 0 else None
        if a is None or b.t - a.t > MAX_SPAN_S * 1e9:
            return None
        share = (t - a.t) / (b.t - a.t)
        return HeadSample(t, a.p + share * (b.p - a.p), slerp(a.q, b.q, share))

    @property
    def newest(self) -> HeadSample | None:
        """The last pose; None while the head is not tracked."""
        return self._samples[-1] if self._samples else None

    def move(self, p: Array, q: Array) -> None:
        """The stage was recentred: the rigid motion old to new takes every pose along."""
        self._samples = [
            None if s is None else HeadSample(s.t, p + rotate(q, s.p), multiply(q, s.q)) for s in self._samples
        ]

    def clear(self) -> None:
        """Forget everything: the stage jumped and nobody knows where to."""
        self._stamps.clear()
        self._samples.clear()

    def _insert(self, t: int, sample: HeadSample | None) -> None:
        place = bisect_left(self._stamps, t)
        if self._stamps and t < self._stamps[-1] - SET_BACK_S * 1e9:
            del self._stamps[place:]
            del self._samples[place:]
        if place < len(self._stamps) and self._stamps[place] == t:
            self._samples[place] = sample
        else:
            self._stamps.insert(place, t)
            self._samples.insert(place, sample)
        old = bisect_right(self._stamps, self._stamps[-1] - int(HORIZON_S * 1e9))
        del self._stamps[:old]
        del self._samples[:old]
