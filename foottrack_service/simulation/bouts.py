"""Bouts of walking: the walk cycle, on this person's legs and feet, along a path and with a person's small variations.

Ankles, feet, pelvis and head move as the walk cycle has them, which is smooth from standing to standing: the heel
lands first, the foot rolls over its ball, and its toes bend. The rigid foot of the truth ends at their joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.config import Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation.anatomy import person, sole
from foottrack_service.simulation.footsteps import Moment, Place, Strides
from foottrack_service.simulation.truth import BOTH, Flags
from foottrack_service.walkcycle.cycle import Cycle, build_cycle
from foottrack_service.walkcycle.footprints import Footprint, Plan
from foottrack_service.walkcycle.parameters import Parameters, with_parameters
from foottrack_service.walkcycle.path import Path
from foottrack_service.walkcycle.presets import preset
from foottrack_service.walkcycle.skeleton import Humanoid, Measures
from foottrack_service.walkcycle.timing import make_clock
from foottrack_service.walkcycle.walk import Walk, walk_along, walk_for
from foottrack_service.walkcycle.wire import body_track, stage_place

STANCE_WIDTH = 0.22
"""m between the ankles, at ease."""
_NORMAL_STEP = 0.70
"""m: at this step the feet pitch as published; in shorter ones in proportion."""
_INSTANT_S = 1e-6
"""How well a walk's clock knows when a phase comes."""


@dataclass(frozen=True)
class Pace:
    """How somebody of 1.75 m walks: `step` m every `interval` s, the ankles `width` m apart.

    Others walk alike, at the same Froude number: steps grow with the leg, time with its root.
    """

    step: float
    interval: float
    width: float


FREE = Pace(0.70, 0.55, 0.13)
"""A stride of 1.40 m in 1.10 s: means of Schwartz 2008."""


@dataclass(frozen=True)
class Carriage:
    """Hips and head at instants (n,), stage: places (n, 3) m, rotations (n, 4). `neck` is the head's joint."""

    hips: Array
    hips_q: Array
    neck: Array
    head_q: Array


@dataclass(frozen=True)
class Bout:
    """One walk from standing to standing, from `start` s on."""

    start: float
    walks: Mapping[Side, Walk]
    """The same walk for each foot, on its own sole."""

    @property
    def end(self) -> float:
        """s."""
        return self.start + self.walks["left"].duration

    def strides(self, side: Side) -> Strides:
        """One foot's part."""
        walk = self.walks[side]
        prints = walk.plan.footprints[side]
        landed = [p for p in prints if np.isfinite(p.strike)]
        contacts = [contact for contact in walk.contacts if contact.side == side]

        def stands(t: Array, intervals: list[tuple[float, float] | None]) -> Flags:
            found = np.zeros(len(t), dtype=np.bool_)
            for first, last in filter(None, intervals):
                found |= (t >= first - _INSTANT_S) & (t <= last + _INSTANT_S)
            return found

        def at(t: Array) -> Moment:
            since = np.clip(t - self.start, 0.0, walk.duration)
            foot = walk.foot(side, since)
            heel = stands(since, [contact.heel for contact in contacts])
            toe = stands(since, [contact.ball for contact in contacts])
            return Moment(stage_place(foot.ankle), foot.yaw, -foot.pitch, heel, toe)

        return Strides(
            self.start,
            self.end,
            _place(prints[-1]),
            self.start + walk.clock.time([p.strike for p in landed]),
            self.start + walk.clock.time([p.flat for p in landed]),
            at,
        )

    def carriage(self, t: Array) -> Carriage:
        """Hips and head at instants (n,) s; before and after the bout they stand."""
        walk = self.walks["left"]
        track = body_track(walk, np.clip(t - self.start, 0.0, walk.duration))
        neck = track.head - rotations.rotate(track.head_rotation, stage_place(walk.body.eyes))
        return Carriage(track.hips, track.hips_rotation, neck, track.head_rotation)


def walked(
    path: Path,
    pace: Pace,
    start: float,
    feet: Mapping[Side, Place],
    settings: Settings,
    random: np.random.Generator,
    seconds: float | None = None,
) -> Bout:
    """A bout along `path`, which begins between the `feet` (in the walk cycle's frame), all of it or for `seconds`.

    Raises PathError when the path is shorter than a step.
    """
    cycles = {side: _cycle(_humanoid(settings, side), pace) for side in BOTH}
    walk = walk_along(cycles["left"], path) if seconds is None else walk_for(cycles["left"], path, seconds)
    plan = _varied(walk, pace, feet, random)
    halves = round(2.0 * (plan.end - plan.start))
    speeds = [
        (index / halves, 1.0 + 0.03 * float(np.clip(random.standard_normal(), -2.0, 2.0))) for index in range(halves)
    ]
    clock = make_clock(plan.start, plan.end, cycles["left"].period, from_rest=True, to_rest=True, speeds=speeds)
    return Bout(start, {side: Walk(cycles[side], path, plan, clock) for side in BOTH})


def between(feet: Mapping[Side, Place]) -> tuple[tuple[float, float], float]:
    """Where a path begins that leads straight ahead from these feet: (x, z) m and yaw rad, in the walk cycle's
    frame."""
    left, right = feet["left"], feet["right"]
    return (-0.5 * (left.x + right.x), -0.5 * (left.z + right.z)), 0.5 * (left.yaw + right.yaw)


def _humanoid(settings: Settings, side: Side) -> Humanoid:
    wearer, shoe = person(settings.body, settings.feet.left.ankle_height), sole(settings.feet.of(side))
    return Humanoid(
        settings.body.height,
        Measures(
            thigh=wearer.thigh,
            shank=wearer.shank,
            hip_width=wearer.hip_spacing,
            torso=wearer.neck_above_hips,
            ankle_height=shoe.ankle_height,
            heel_behind=shoe.heel_z,
            ball_ahead=shoe.ball_z,
        ),
    )


@lru_cache(maxsize=32)
def _cycle(body: Humanoid, pace: Pace) -> Cycle:
    project = preset("normative")
    parameters = Parameters(speed=pace.step / pace.interval, step_length=pace.step)
    cycle = build_cycle(with_parameters(project, parameters), body)
    return replace(cycle, stance_x={"left": 0.5 * pace.width, "right": -0.5 * pace.width})


def _varied(walk: Walk, pace: Pace, feet: Mapping[Side, Place], random: np.random.Generator) -> Plan:
    """Nobody hits a spot to the millimetre: the plan from where the feet are, to where they stand at ease."""
    roll = pace.step / _NORMAL_STEP
    found: dict[str, list[Footprint]] = {}
    for side, sign in zip(BOTH, (1.0, -1.0), strict=True):
        ahead, left, turn = random.uniform(-1.0, 1.0, (3, len(walk.plan.footprints[side])))
        lift, land = 1.0 + 0.08 * np.clip(random.standard_normal((2, len(ahead))), -2.0, 2.0)
        prints = []
        for i, footprint in enumerate(walk.plan.footprints[side]):
            moved = replace(footprint, lift=footprint.lift * roll * lift[i], land=footprint.land * roll * land[i])
            if i == 0:
                place = feet[side]
                at = (-place.x, -place.z)
                arc, aside = walk.path.project(at)
                moved = replace(moved, place=at, yaw=place.yaw, arc=arc, aside=aside)
            else:
                wider = 0.5 * sign * (STANCE_WIDTH - pace.width) if footprint.toe_off == np.inf else 0.0
                moved = moved.moved(
                    walk.path, 0.015 * float(ahead[i]), wider + 0.01 * float(left[i]), np.radians(2.0) * float(turn[i])
                )
            prints.append(moved)
        found[side] = prints
    return replace(walk.plan, footprints=found)


def _place(footprint: Footprint) -> Place:
    x, z = footprint.place
    return Place(-x, -z, footprint.yaw)
