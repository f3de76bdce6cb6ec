"""Key-frame animation, [Z]'s comparison: a clip that plays whenever a foot rises or falls, not synchronised with it."""

from __future__ import annotations

from foottrack_service.gait.legs import LegTarget, LegTargets, pelvis_drop
from foottrack_service.gait.steps import Feet, Steps

CYCLE_S = 1.0
"""Two steps: 12 frames each at 24 frames per second, [L]."""
CLIP = (
    # z m, ankle's height m, pitch rad (toes up); eighths of the cycle from contact
    (0.30, 0.01, 0.25),
    (0.15, 0.00, 0.00),
    (0.00, 0.00, 0.00),
    (-0.15, 0.01, -0.10),
    (-0.30, 0.06, -0.45),
    (-0.22, 0.14, -0.70),
    (0.02, 0.12, -0.25),
    (0.24, 0.05, 0.20),
)
"""One foot, [L]'s contact, down, pass and up; the other is half a cycle later."""
_BLEND_S = 0.15
_HOLD_S = 0.3
"""Between two swings the clip waits so long for the next before the legs go back to the stand."""


class KeyframeLegs:
    """``leg`` is the wearer's, m."""

    def __init__(self, leg: float) -> None:
        self._leg = leg
        self._clock = 0.0
        self._weight = 0.0
        self._idle_s = _HOLD_S

    def update(self, t: int, dt: float, feet: Feet, steps: Steps) -> LegTargets:
        """Targets at ``t`` ns."""
        playing = any(foot.phase in ("ascending", "descending") for foot in feet)
        self._idle_s = 0.0 if playing else self._idle_s + dt
        if playing:
            self._clock = (self._clock + dt / CYCLE_S) % 1.0
        change = dt / _BLEND_S
        wanted = 1.0 if self._idle_s < _HOLD_S else 0.0
        self._weight += min(max(wanted - self._weight, -change), change)
        left, right = self._foot(self._clock), self._foot(self._clock + 0.5)
        drop = pelvis_drop(self._leg, left.z, right.z)
        return LegTargets(left, right, -drop, steps.speed(t), steps.walking)

    def _foot(self, share: float) -> LegTarget:
        at = (share % 1.0) * len(CLIP)
        key = int(at) % len(CLIP)
        before, after, between = CLIP[key], CLIP[(key + 1) % len(CLIP)], at - int(at)
        z, y, pitch = ((a + (b - a) * between) * self._weight for a, b in zip(before, after, strict=True))
        return LegTarget(z, y, pitch)
