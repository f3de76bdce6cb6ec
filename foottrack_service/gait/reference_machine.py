"""[Z]'s phases of one foot, at 30 Hz on smoothed heights.

Legible in the paper are "stance -[h > p1, v > v1]-> ascending", the thresholds and the filter. The other transitions
are our reconstruction: ascending -[|v| < v1]-> mid swing -[v < -v1]-> descending -[h < p1 or v > -v1]-> terminal swing
-[h < p1, |v| < v2]-> stance.
"""

from __future__ import annotations

import math

from foottrack_service.gait.foot_phases import Phase

RATE_HZ = 30.0
P1 = 0.1
"""m."""
V1, V2 = 0.2, 0.6
"""m/s."""
CUTOFF_HZ = 4.0
FLOOR_S = 3.0
"""The floor is the mean height of the ankle over so long a stand."""
_STANDING_SPEED, _STANDING_NEAR = 0.1, 0.03
"""m/s, m: what counts as standing for that mean."""


class Butterworth:
    """Second order low pass, causal, by the bilinear transform."""

    def __init__(self, cutoff_hz: float, rate_hz: float) -> None:
        k = math.tan(math.pi * cutoff_hz / rate_hz)
        norm = 1.0 / (1.0 + math.sqrt(2.0) * k + k * k)
        self._b = k * k * norm
        self._a = (2.0 * (k * k - 1.0) * norm, (1.0 - math.sqrt(2.0) * k + k * k) * norm)
        self._state: tuple[float, float] | None = None

    def __call__(self, x: float) -> float:
        """The next output; the first input counts as having been there always."""
        if self._state is None:
            self._state = (x * (1.0 - self._b), x * (self._b - self._a[1]))
        first, second = self._state
        y = self._b * x + first
        self._state = (2.0 * self._b * x - self._a[0] * y + second, self._b * x - self._a[1] * y)
        return y


class ReferencePhases:
    """One foot: feed ``update`` with ankle heights (m, stage) 30 times a second."""

    def __init__(self) -> None:
        self.phase: Phase = "stance"
        self.h = self.v = self.peak = self.path = 0.0
        """Smoothed height above the floor m, raw velocity m/s; of this swing: peak and way, m."""
        self.frames = 0
        """Of this swing."""
        self._smooth = Butterworth(CUTOFF_HZ, RATE_HZ)
        self._raw: float | None = None
        self._sum, self._count = 0.0, 0

    def update(self, ankle: float) -> Phase | None:
        """The phase that was entered, if one was."""
        smooth = self._smooth(ankle)
        self.v = 0.0 if self._raw is None else (ankle - self._raw) * RATE_HZ
        self._raw = ankle
        floor = self._floor(ankle)
        self.h = smooth - floor
        self.peak, self.path = max(self.peak, self.h), self.path + abs(self.v) / RATE_HZ
        self.frames += 1
        entered = self._next()
        if entered is not None:
            self.phase = entered
            if entered == "ascending":
                self.peak, self.path, self.frames = self.h, 0.0, 0
        return entered

    def _floor(self, ankle: float) -> float:
        near = self._count == 0 or abs(ankle - self._sum / self._count) < _STANDING_NEAR
        if self._count < FLOOR_S * RATE_HZ and abs(self.v) < _STANDING_SPEED and near:
            self._sum, self._count = self._sum + ankle, self._count + 1
        return self._sum / self._count if self._count else ankle

    def _next(self) -> Phase | None:
        h, v = self.h, self.v
        if self.phase == "stance":
            return "ascending" if h > P1 and v > V1 else None
        if self.phase == "ascending":
            return "mid_swing" if abs(v) < V1 else "descending" if v < -V1 else None
        if self.phase == "mid_swing":
            return "descending" if v < -V1 else None
        if self.phase == "descending":
            return "terminal_swing" if h < P1 or v > -V1 else None
        return "stance" if h < P1 and abs(v) < V2 else None
