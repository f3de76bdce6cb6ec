"""Key-frame animation, [Z]'s comparison: a clip that plays whenever a foot rises or falls, not synchronised with it."""

from __future__ import annotations

from functools import lru_cache

from foottrack_service.gait.legs import LegTarget, LegTargets, pelvis_drop
from foottrack_service.gait.steps import Feet, Steps

PRESET = "animator"
"""The walk cycle of the textbook's four poses [L]."""
FRAMES, FRAMES_PER_S = 24, 24.0
"""Two steps of 12 frames each [L]."""
CYCLE_S = FRAMES / FRAMES_PER_S
_BLEND_S = 0.15
_HOLD_S = 0.3
"""Between two swings the clip waits so long for the next before the legs go back to the stand."""


class KeyframeLegs:
    """``leg`` is the wearer's, m."""

    def __init__(self, leg: float) -> None:
        self._leg = leg
        self._clip = clip(leg)
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
        at = (share % 1.0) * FRAMES
        frame, between = int(at) % FRAMES, at - int(at)
        before, after = self._clip[frame], self._clip[(frame + 1) % FRAMES]
        z, y, pitch = ((a + (b - a) * between) * self._weight for a, b in zip(before, after, strict=True))
        return LegTarget(z, y, pitch)


@lru_cache(maxsize=4)
def clip(leg: float) -> tuple[LegTarget, ...]:
    """One foot through the cycle, from its strike on, for legs of this length, m; the other is half a cycle later."""
    # Here, since few choose this mode and scipy takes its time.
    from foottrack_service.walkcycle.cycle import build_cycle
    from foottrack_service.walkcycle.inplace import in_place_targets
    from foottrack_service.walkcycle.presets import preset

    cycle = build_cycle(preset(PRESET))
    scale = leg / cycle.body.leg
    foot = in_place_targets(cycle, [frame / FRAMES for frame in range(FRAMES)]).feet["left"]
    standing = cycle.body.ankle_height
    return tuple(
        LegTarget(scale * z, scale * max(0.0, y - standing), pitch)
        for (_, y, z), pitch in zip(foot.ankle.tolist(), foot.pitch.tolist(), strict=True)
    )
