"""Steps from the headset alone: who walks in place bobs up and down once per step.

The head's height, freed of what is slower than a step, falls and rises; each rise after a fall is a step, the feet
taking turns. What comes out are feet as fusion would see them, so that everything behind stays the same.
"""

from __future__ import annotations

import math
from collections import deque

from foottrack_service.gait.samples import FootSample, HeadSample

_SLOW_S, _FAST_S = 0.45, 0.02
"""s: the band of a step."""
_LEAST_BOB, _MOST_BOB = 0.006, 0.15
"""m, from the lowest to the highest: less is breathing and sway, more a squat or a jump."""
_BOB_SHARE = 0.3
"""Of the last bobs' size: what a new one has to reach."""
_SOONEST_S, _LATEST_S = 0.22, 1.1
"""s between two steps."""
_MOST_SPEED = 0.6
"""m/s: a head that goes so fast walks through the room."""
_SPEED_S = 0.3
_PEAK = 0.12
"""m: how high the feet are lifted that nobody sees."""
_SWING_SHARE = 0.75
"""Of the interval."""
_DELAY_NS = 90_000_000
"""From the head's lowest point to the step, which is seldom known earlier: an even delay keeps an even pace."""
_HALF_STANCE = 0.1
"""m."""
_HOLE_S = 0.3


class HeadBob:
    """``height`` is the person's, m."""

    def __init__(self, height: float) -> None:
        self._scale = height / 1.75
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._t: int | None = None
        self._slow = self._fast = 0.0
        self._place = (0.0, 0.0)
        self._travel = [0.0, 0.0]
        self._falling = False
        self._extreme = 0.0
        self._extreme_t = 0
        self._bobs: deque[float] = deque(maxlen=4)
        self._last_step: int | None = None
        self._intervals: deque[float] = deque(maxlen=3)
        self._next = 0
        self._begun: list[int | None] = [None, None]
        self._lasts = [0.4, 0.4]

    def update(self, t: int, head: HeadSample) -> tuple[FootSample, FootSample]:
        """The feet at ``t`` ns."""
        dt = math.inf if self._t is None else (t - self._t) * 1e-9
        x, y, z = head.p
        if not 0.0 < dt < _HOLE_S:
            if dt != 0.0:
                self.reset()
                self._t, self._slow, self._fast, self._place = t, y, y, (x, z)
            return self._foot(t, 0), self._foot(t, 1)
        self._t = t
        self._slow += (y - self._slow) * (1.0 - math.exp(-dt / _SLOW_S))
        self._fast += (y - self._fast) * (1.0 - math.exp(-dt / _FAST_S))
        share = 1.0 - math.exp(-dt / _SPEED_S)
        for index, (now, before) in enumerate(zip((x, z), self._place, strict=True)):
            self._travel[index] += share * ((now - before) / dt - self._travel[index])
        self._place = (x, z)
        self._follow(t, self._fast - self._slow)
        return self._foot(t, 0), self._foot(t, 1)

    def _follow(self, t: int, bob: float) -> None:
        """Turning points of the bob, with hysteresis."""
        usual = sum(self._bobs) / len(self._bobs) if self._bobs else 0.0
        needed = max(_LEAST_BOB * self._scale, _BOB_SHARE * usual)
        if self._falling:
            if bob < self._extreme:
                self._extreme, self._extreme_t = bob, t
            elif bob - self._extreme > needed:
                self._falling = False
                self._rise(self._extreme_t)
                self._extreme, self._extreme_t = bob, t
        elif bob > self._extreme:
            self._extreme, self._extreme_t = bob, t
        elif self._extreme - bob > needed:
            self._bobs.append(self._extreme - bob)
            self._falling = True
            self._extreme, self._extreme_t = bob, t

    def _rise(self, low: int) -> None:
        size = self._bobs[-1] if self._bobs else 0.0
        if size > _MOST_BOB * self._scale or math.hypot(*self._travel) > _MOST_SPEED:
            self._last_step = None
            return
        last, self._last_step = self._last_step, low
        if last is None:
            return
        interval = (low - last) * 1e-9
        if not _SOONEST_S < interval < _LATEST_S:
            self._intervals.clear()
            return
        self._intervals.append(interval)
        self._begun[self._next] = max(low + _DELAY_NS, self._t or 0)
        self._lasts[self._next] = _SWING_SHARE * min(sum(self._intervals) / len(self._intervals), 0.8)
        self._next = 1 - self._next

    def _foot(self, t: int, index: int) -> FootSample:
        begun, lasts = self._begun[index], self._lasts[index]
        share = 1.0 if begun is None else (t - begun) * 1e-9 / lasts
        share = share if share > 0.0 else 1.0
        height = vy = 0.0
        if share < 1.0:
            height = _PEAK * math.sin(math.pi * share) ** 2
            vy = _PEAK * math.pi / lasts * math.sin(2.0 * math.pi * share)
        x = -_HALF_STANCE if index == 0 else _HALF_STANCE
        return FootSample((x, height, 0.0), (0.0, 0.0, 0.0, 1.0), (0.0, vy, 0.0), share >= 1.0)
