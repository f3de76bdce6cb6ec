"""Walks along curved paths: places and times of the steps are the walk cycle's, the feet's motion is the simulation's.

The walk cycle plans footprints on a path, with heel, flat and ball phases and a start and an end at rest; the
simulation's own feet then roll over them with a specific force that is continuous throughout.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from foottrack_service.config import Settings
from foottrack_service.simulation.footsteps import Place, Step
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.people import scene
from foottrack_service.simulation.posture import Bearing
from foottrack_service.simulation.stride import WALKING, Planner
from foottrack_service.simulation.truth import BOTH, Truth
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.footprints import Footprint
from foottrack_service.walkcycle.path import s_curve
from foottrack_service.walkcycle.presets import preset
from foottrack_service.walkcycle.skeleton import Humanoid
from foottrack_service.walkcycle.walk import Walk, walk_for

_LEAD_S = 1.5
_TAIL_S = 1.0
_MOST_SPEED = 1.5
"""m/s: the path is long enough for the whole time."""
_BEND = 0.25
"""Width of the S over its length: turns of about 40 deg to either side."""
_SHORTEST_ROLL_S = 0.12
_SHORTEST_SETTLE_S = 0.05


def s_walk(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """A normal walk along an S, from standing to standing."""
    length = _MOST_SPEED * seconds
    cycle = build_cycle(preset("normative"), Humanoid(settings.body.height))
    walk = walk_for(cycle, s_curve(length, _BEND * length), seconds - _LEAD_S - _TAIL_S)
    plan = Planner(random)
    for side in BOTH:
        prints = walk.plan.footprints[side]
        plan.start[side] = plan.feet[side] = _place(prints[0])
        plan.steps[side] = _steps(walk, prints)
    return scene(seconds, settings, feet, random, plan, Bearing())


def _steps(walk: Walk, prints: list[Footprint]) -> list[Step]:
    steps: list[Step] = []
    earliest = 0.0
    for left, landed in pairwise(prints):
        heel_off, off, strike, flat = (
            float(walk.clock.time(phase)) + _LEAD_S
            for phase in (left.heel_off, left.toe_off, landed.strike, landed.flat)
        )
        style = replace(
            WALKING,
            swing=strike - off,
            roll=max(min(off - heel_off, off - earliest), _SHORTEST_ROLL_S),
            settle=max(flat - strike, _SHORTEST_SETTLE_S),
            toe_off_pitch=WALKING.toe_off_pitch * left.lift,
            toe_off_rate=WALKING.toe_off_rate * left.lift,
            strike_pitch=WALKING.strike_pitch * landed.land,
        )
        steps.append(Step(off, _place(landed), style))
        earliest = steps[-1].flat
    return steps


def _place(footprint: Footprint) -> Place:
    x, z = footprint.place
    return Place(-x, -z, footprint.yaw)
