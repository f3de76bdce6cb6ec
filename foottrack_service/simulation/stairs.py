"""Up two stairs and down again, backwards: feet stand where the floor is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation import footwear
from foottrack_service.simulation.anatomy import person, sole
from foottrack_service.simulation.easing import ease
from foottrack_service.simulation.footsteps import Step, stepping
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.posture import Bearing, Extra, carried
from foottrack_service.simulation.stride import CAUTIOUS, Planner
from foottrack_service.simulation.truth import Truth, grid

RISE, TREAD = 0.17, 0.32
"""m of one stair."""
STAIRS = 2
_STYLE = replace(CAUTIOUS, strike_pitch=0.0, lift=0.08)
"""The whole foot is put down at once."""
_STAND_S = 1.5


def stairs(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """One foot up, the other beside it, both stairs; a rest; down again. Hips and head rise with the feet's mean,
    as far as the lower leg reaches."""
    plan = Planner(random)
    rises: dict[Side, list[tuple[Step, float]]] = {"left": [], "right": []}
    way = 1
    while plan.now < seconds - 8.0:
        for _ in range(STAIRS):
            goals = {side: place.ahead(way * TREAD) for side, place in plan.feet.items()}
            for side, goal in goals.items():
                plan.step(side, goal, _STYLE, 0.9)
                step = plan.steps[side][-1]
                assert isinstance(step, Step)
                rises[side].append((step, way * RISE))
        plan.stand(_STAND_S)
        way = -way
    t = grid(seconds)
    samples = {
        side: stepping(t, plan.start[side], plan.steps[side], sole(settings.feet.of(side))) for side in plan.start
    }
    heights = {side: _heights(t, taken) for side, taken in rises.items()}
    for side, foot in samples.items():
        foot.p[:, 1] += heights[side]
    wearer = person(settings.body, settings.feet.left.ankle_height)
    climb = Extra(crouch=-0.5 * (heights["left"] + heights["right"]))
    head, hips = carried(samples["left"], samples["right"], wearer, Bearing(), climb, random)
    tracks = {side: footwear.track(foot, sole(settings.feet.of(side)), feet, random) for side, foot in samples.items()}
    return Truth(seconds, head, tracks, hips)


def _heights(t: Array, rises: Sequence[tuple[Step, float]]) -> Array:
    """What the stairs add to a foot's height, (n,) m."""
    height = np.zeros_like(t)
    for step, rise in rises:
        height += rise * ease((t - step.start) / step.style.swing)
    return height
