"""Plans of steps: a person who stands, steps and turns, one foot at a time, and walks in between."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.simulation.bouts import STANCE_WIDTH, Bout, Pace, between, walked
from foottrack_service.simulation.footsteps import Place, Step, Strides, Style
from foottrack_service.simulation.truth import BOTH
from foottrack_service.walkcycle.path import Path

CAUTIOUS = Style(swing=0.55, roll=0.25, settle=0.12, toe_off_pitch=0.5, toe_off_rate=1.5, strike_pitch=-0.15, lift=0.06)
"""Single steps in a room, with a headset on."""
IN_PLACE = Style(swing=0.42, roll=0.14, settle=0.08, toe_off_pitch=0.45, toe_off_rate=2.0, strike_pitch=0.0, lift=0.12)
"""Walking in place: the foot comes down flat."""


@dataclass
class Planner:
    """Collects the steps of both feet. `now` is the earliest instant of the next toe-off, s."""

    random: np.random.Generator
    now: float = 1.0
    feet: dict[Side, Place] = field(
        default_factory=lambda: {
            "left": Place(-0.5 * STANCE_WIDTH, 0.0, 0.0),
            "right": Place(0.5 * STANCE_WIDTH, 0.0, 0.0),
        }
    )
    steps: dict[Side, list[Step | Strides]] = field(default_factory=lambda: {"left": [], "right": []})
    start: dict[Side, Place] = field(init=False)
    bouts: list[Bout] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.start = dict(self.feet)

    def stand(self, seconds: float) -> None:
        """Wait."""
        self.now += seconds

    def step(self, side: Side, place: Place, style: Style, interval: float) -> None:
        """One foot goes to `place`; the next toe-off comes `interval` s later (and varies by 3 %)."""
        varied = self._varied(style)
        taken = self.steps[side]
        start = max(self.now, taken[-1].flat + varied.roll + 0.02) if taken else self.now
        taken.append(Step(start, self._scattered(place), varied))
        self.feet[side] = place
        self.now = start + interval * (1.0 + 0.03 * float(np.clip(self.random.standard_normal(), -2.0, 2.0)))

    def walk(self, path: Path, pace: Pace, settings: Settings, seconds: float | None = None) -> None:
        """Along `path`, which begins here and ahead, all of it or for `seconds`; the feet end side by side."""
        taken = {side: self.steps[side][-1].place if self.steps[side] else self.start[side] for side in BOTH}
        start = max([self.now, *(self.steps[side][-1].flat for side in BOTH if self.steps[side])])
        bout = walked(path.moved(*between(taken)), pace, start, taken, settings, self.random, seconds)
        for side in BOTH:
            self.steps[side].append(bout.strides(side))
            self.feet[side] = self.steps[side][-1].place
        self.bouts.append(bout)
        self.now = bout.end

    def turn(self, angle: float, style: Style, interval: float) -> None:
        """On the spot by `angle` rad (positive to the left), at most 50 deg a step."""
        middle = self.middle()
        count = max(1, math.ceil(abs(angle) / math.radians(50.0)))
        first: Side = "left" if angle > 0.0 else "right"
        for index in range(count + 1):
            side: Side = first if index % 2 == 0 else other(first)
            turned = middle.ahead(0.0, 0.0, angle * min(index + 1, count) / count)
            self.step(side, turned.ahead(0.0, STANCE_WIDTH * (-0.5 if side == "left" else 0.5)), style, interval)

    def middle(self) -> Place:
        """Between the feet."""
        left, right = self.feet["left"], self.feet["right"]
        return Place(0.5 * (left.x + right.x), 0.5 * (left.z + right.z), 0.5 * (left.yaw + right.yaw))

    def _varied(self, style: Style) -> Style:
        factor = 1.0 + 0.08 * np.clip(self.random.standard_normal(3), -2.0, 2.0)
        return replace(
            style,
            lift=style.lift * float(factor[0]),
            toe_off_pitch=style.toe_off_pitch * float(factor[1]),
            strike_pitch=style.strike_pitch * float(factor[2]),
        )

    def _scattered(self, place: Place) -> Place:
        """Nobody hits a spot to the millimetre."""
        ahead, right, turn = self.random.uniform(-1.0, 1.0, 3)
        return place.ahead(0.015 * float(ahead), 0.01 * float(right), math.radians(2.0) * float(turn))


def other(side: Side) -> Side:
    """The other side."""
    return "right" if side == "left" else "left"
