"""Walking in place at a chosen cadence and with a chosen lift of the feet, and what is easily taken for it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.simulation.anatomy import Sole, sole
from foottrack_service.simulation.easing import there_and_back
from foottrack_service.simulation.footsteps import Place, Step, Style, stepping
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.people import scene
from foottrack_service.simulation.posture import Bearing, Extra
from foottrack_service.simulation.stride import CAUTIOUS, IN_PLACE, Planner, other
from foottrack_service.simulation.tasks import Maker
from foottrack_service.simulation.truth import Truth, grid

_LIFT_OFF_SLOPE = 3.0
"""rad per m of peak: a low step leaves the floor with an almost level foot."""
_SWING_SHARE = 0.38
"""Of a stride: toe-off to strike."""


def marching(cadence: float, peak: float, turn: float = 0.0) -> Maker:
    """Bouts of 8 to 14 steps at ``cadence`` steps/s with ankles raised by ``peak`` m, and pauses of 1.5 to 2.5 s.

    With ``turn``, rad, each foot is put down turned by so much against the middle of both, which turns the person by
    two thirds of it a step. Raises ValueError for what nobody can do.
    """
    if not (0.3 <= cadence <= 4.0 and 0.02 <= peak <= 0.6):
        raise ValueError(f"nobody walks in place at {cadence:g} steps/s with feet raised by {peak:g} m")

    def truth(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
        style = style_of(cadence, peak, sole(settings.feet.left))
        plan = Planner(random)
        side: Side = "left" if random.random() < 0.5 else "right"
        while plan.now < seconds - 3.0:
            for _ in range(int(random.integers(8, 15))):
                if plan.now > seconds - 1.5:
                    break
                place = plan.start[side]
                if turn:
                    place = _turned(plan, side, turn)
                plan.step(side, place, style, 1.0 / cadence)
                side = other(side)
            plan.stand(random.uniform(1.5, 2.5))
        return scene(seconds, settings, feet, random, plan, Bearing())

    return truth


def turning(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Turns on the spot by 90 to 180 deg to either side, in small steps."""
    plan = Planner(random)
    direction = 1.0
    while plan.now < seconds - 5.0:
        plan.turn(direction * random.uniform(0.5, 1.0) * math.pi, CAUTIOUS, 0.7)
        plan.stand(random.uniform(1.0, 1.5))
        direction = -direction
    return scene(seconds, settings, feet, random, plan, Bearing())


def leaning(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Leans forward over standing feet, by 10 to 25 cm."""
    t = grid(seconds)
    lean = np.zeros_like(t)
    start = 1.5
    while start + 3.0 < seconds:
        lean += random.uniform(0.1, 0.25) * there_and_back(t, start, start + 2.5)
        start += 2.5 + random.uniform(0.1, 0.6)
    return scene(seconds, settings, feet, random, Planner(random), Bearing(), Extra(lean=lean, crouch=0.3 * lean))


@lru_cache(maxsize=64)
def style_of(cadence: float, peak: float, shoe: Sole) -> Style:
    """How a foot is moved so that the ankle's highest point is ``peak`` m above its standing height."""
    swing = min(0.6, _SWING_SHARE * 2.0 / cadence)
    pitch = min(IN_PLACE.toe_off_pitch, _LIFT_OFF_SLOPE * peak)
    style = replace(
        IN_PLACE,
        swing=swing,
        roll=min(0.14, 0.33 * swing),
        settle=min(0.08, 0.2 * swing),
        toe_off_pitch=pitch,
        toe_off_rate=IN_PLACE.toe_off_rate * pitch / IN_PLACE.toe_off_pitch,
        lift=peak,
    )
    place, t = Place(0.0, 0.0, 0.0), np.arange(0.0, 2.0, 0.002)
    for _ in range(8):
        reached = float(np.max(stepping(t, place, [Step(0.5, place, style)], shoe).p[:, 1])) - shoe.ankle_height
        style = replace(style, lift=style.lift + peak - reached)
    return style


def _turned(plan: Planner, side: Side, turn: float) -> Place:
    middle = plan.middle()
    offset = -0.11 if side == "left" else 0.11
    return middle.ahead(0.0, 0.0, turn).ahead(0.0, offset)
