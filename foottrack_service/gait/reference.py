"""[Z]'s walking in place as published: 30 Hz, its thresholds, its equations. The baseline beside ours."""

from __future__ import annotations

from foottrack_service.gait import reference_equations as eq
from foottrack_service.gait.legs import LegTarget, LegTargets
from foottrack_service.gait.reference_machine import RATE_HZ, ReferencePhases
from foottrack_service.gait.speed import Amplitude
from foottrack_service.gait.steps import Feet, Steps

STOP_S = 1.5
"""Of double support."""
LERP = 0.3
"""Share of the way that a smoothed target goes per frame. The paper does not give it."""
_PERIOD_NS = round(1e9 / RATE_HZ)


class ReferenceLegs:
    """With ``lerp`` its targets are smoothed, as in the paper; without, the raw equations show."""

    def __init__(self, *, lerp: bool = True, most_speed: float = 3.5) -> None:
        self._share = LERP if lerp else 1.0
        self._most = most_speed
        self.phases = (ReferencePhases(), ReferencePhases())
        self.steps = 0
        """Seen so far."""
        self._model = Amplitude()
        self._due: int | None = None
        self._stepping: int | None = None
        self._walking = False
        self._first = True
        self._still = 0
        self._z = [0.0, 0.0]
        self._shown = [[0.0, 0.0], [0.0, 0.0], [0.0]]
        self._targets = LegTargets(LegTarget(0.0, 0.0, 0.0), LegTarget(0.0, 0.0, 0.0), 0.0, 0.0, False)

    def update(self, t: int, dt: float, feet: Feet, steps: Steps) -> LegTargets:
        """Targets at ``t`` ns: those of the last frame."""
        if self._due is None or t >= self._due:
            self._due = t + _PERIOD_NS if self._due is None or t - self._due > _PERIOD_NS else self._due + _PERIOD_NS
            self._frame([foot.ankle_y for foot in feet])
        return self._targets

    def _frame(self, ankles: list[float | None]) -> None:
        for index, (phases, ankle) in enumerate(zip(self.phases, ankles, strict=True)):
            entered = phases.update(ankle) if ankle is not None else None
            if entered == "ascending":
                self._first = not self._walking
                self._stepping, self._walking = index, True
                self.steps += 1
            elif entered in ("mid_swing", "terminal_swing"):
                self._model.event(entered, 0.0, phases.peak, phases.path / max(phases.frames / RATE_HZ, 0.1))
        double_support = all(phases.phase == "stance" for phases in self.phases)
        self._still = self._still + 1 if double_support else 0
        if self._walking and self._still >= STOP_S * RATE_HZ:
            self._walking = False
            self._z = [0.0, 0.0]
            self._model.stop()
        heights = self._equations()
        drop = eq.body_drop(min(self._z)) if self._walking else 0.0
        self._show(heights, drop)

    def _equations(self) -> list[float]:
        heights = [0.0, 0.0]
        s = self._stepping
        if s is None or not self._walking:
            return heights
        stepping = self.phases[s]
        if stepping.phase in ("ascending", "descending"):
            equation = eq.first_step if self._first else eq.next_step
            self._z[s], self._z[1 - s] = equation(stepping.h, up=stepping.phase == "ascending")
        if stepping.phase != "stance":
            heights[s] = max(0.0, stepping.h) / 2.0
        return heights

    def _show(self, heights: list[float], drop: float) -> None:
        for shown, wanted in zip(
            self._shown, ([self._z[0], heights[0]], [self._z[1], heights[1]], [drop]), strict=True
        ):
            for index, value in enumerate(wanted):
                shown[index] += self._share * (value - shown[index])
        left, right, (shown_drop,) = self._shown
        speed = min(self._model.speed(0.0), self._most) if self._walking else 0.0
        self._targets = LegTargets(
            LegTarget(left[0], left[1], 0.0), LegTarget(right[0], right[1], 0.0), -shown_drop, speed, self._walking
        )
