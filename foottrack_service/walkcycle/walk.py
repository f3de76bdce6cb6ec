"""A walk along a path: planted footprints, warped swings, legs closed by inverse kinematics.

`Walk.targets` says where the pelvis and the feet are at any instants; `close_legs` turns that into joint
rotations. Everything is a function of time alone, so any instants in any order give the same walk.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.curves import smooth_step
from foottrack_service.walkcycle.cycle import Cycle
from foottrack_service.walkcycle.errors import PathError
from foottrack_service.walkcycle.footprints import Footprint, Plan, plan_walk
from foottrack_service.walkcycle.legs import close_leg, reachable_height
from foottrack_service.walkcycle.path import Path
from foottrack_service.walkcycle.rollover import ball_share, rolled_ankle, toes_above_floor
from foottrack_service.walkcycle.skeleton import INDEX, JOINTS, POSED_JOINTS, SIDES, Humanoid
from foottrack_service.walkcycle.standing import standing_pose
from foottrack_service.walkcycle.timing import Clock, make_clock

Array = npt.NDArray[np.float64]

_MOMENT_S = 5e-4
_SLOWEST = 0.25
"""Share of the cycle's period: no change of speed makes a cycle shorter than that."""


@dataclass(frozen=True)
class FootTargets:
    """One foot: `ankle` (n, 3) m, `yaw`, `pitch` and `toes_pitch` (against the floor), each (n,) rad."""

    ankle: Array
    yaw: Array
    pitch: Array
    toes_pitch: Array

    @property
    def rotation(self) -> Array:
        """World rotations (n, 4) of the foot."""
        return rot.multiply(rot.from_yaw(self.yaw), rot.from_axis_angle([-1.0, 0.0, 0.0], self.pitch))


@dataclass(frozen=True)
class Targets:
    """Where everything should be: `hips` (n, 3) m, `joints` per posed joint (n, 4), `feet` per side."""

    phase: Array
    hips: Array
    joints: dict[str, Array]
    feet: dict[str, FootTargets]


@dataclass(frozen=True)
class Motion:
    """Joint rotations over time, as a file holds them: `times` (n,) s, `hips` (n, 3) m, `rotations` (n, 22, 4)
    joint to parent."""

    times: Array
    hips: Array
    rotations: Array


@dataclass(frozen=True)
class Contact:
    """One contact in seconds: `heel` and `ball` are the intervals during which each point is planted; None where it
    never is."""

    side: str
    heel: tuple[float, float] | None
    ball: tuple[float, float] | None
    print: Footprint


@dataclass(frozen=True)
class Walk:
    """A cycle on a path. Build it with `walk_along`."""

    cycle: Cycle
    path: Path
    plan: Plan
    clock: Clock

    @property
    def body(self) -> Humanoid:
        return self.cycle.body

    @property
    def duration(self) -> float:
        return self.clock.duration

    def times(self, fps: float) -> Array:
        """Instants from 0 to at most the duration, (n,) s."""
        return np.arange(int(np.floor(self.duration * fps + 1e-9)) + 1) / fps

    def targets(self, times: npt.ArrayLike) -> Targets:
        """Pelvis and feet at instants (n,) s. Raises ReachError where the legs cannot follow."""
        phase = np.atleast_1d(self.clock.phase(times))
        feet = {side: self._foot(side, phase) for side in SIDES}
        arc = self._guide(phase)
        heading = rot.from_yaw(self.path.heading(arc))
        awake = self._awake(phase)
        rest_hips, rest_joints = standing_pose(self.body)
        place = self.cycle.hips(phase)
        local = awake[:, None] * place + (1.0 - awake[:, None]) * rest_hips
        ground = self.path.place(arc)
        hips = np.stack([ground[:, 0], np.zeros_like(arc), ground[:, 1]], axis=-1) + rot.rotate(heading, local)
        joints = {name: rot.slerp(rest_joints[name], self.cycle.joints[name](phase), awake) for name in POSED_JOINTS}
        joints["hips"] = rot.multiply(heading, joints["hips"])
        ankles = {side: feet[side].ankle for side in SIDES}
        hips[:, 1] = reachable_height(self.body, hips, joints["hips"], ankles, phase)
        return Targets(phase, hips, joints, feet)

    def foot(self, side: str, times: npt.ArrayLike) -> FootTargets:
        """One foot alone at instants (n,) s."""
        return self._foot(side, np.atleast_1d(self.clock.phase(times)))

    def motion(self, times: npt.ArrayLike) -> Motion:
        """Joint rotations at instants (n,) s."""
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        return close_legs(self.body, times, self.targets(times))

    def ground(self, times: npt.ArrayLike) -> tuple[Array, Array]:
        """The guide on the path at instants (n,) s: heading (n,) rad and speed (n,) m/s."""
        times = np.atleast_1d(np.asarray(times, dtype=np.float64))
        arc = self._guide(self.clock.phase(times))
        ahead, behind = np.minimum(times + _MOMENT_S, self.duration), np.maximum(times - _MOMENT_S, 0.0)
        gone = self._guide(self.clock.phase(ahead)) - self._guide(self.clock.phase(behind))
        return self.path.heading(arc), np.asarray(gone / np.maximum(ahead - behind, _MOMENT_S))

    @cached_property
    def contacts(self) -> list[Contact]:
        """All contacts in the order of their strikes."""
        found = []
        for side in SIDES:
            on_ball = self.cycle.feet[side].strikes_on_ball
            for p in self.plan.footprints[side]:
                edges = self.clock.time(np.clip([p.strike, p.flat, p.heel_off, p.toe_off], -1e9, 1e9))
                strike, flat, heel_off, toe_off = (float(edge) for edge in edges)
                heel = (flat if on_ball else strike, heel_off)
                ball = (strike if on_ball else flat, toe_off)
                if toe_off > strike:
                    found.append(Contact(side, _interval(heel), _interval(ball), p))
        return sorted(found, key=lambda contact: contact.print.arc)

    def _guide(self, phase: Array) -> Array:
        """Arc length (n,) m of the pelvis' guide on the path."""
        knots, arcs = self.plan.knots
        return np.asarray(CubicSpline(knots, arcs, bc_type="natural")(phase))

    def _awake(self, phase: Array) -> Array:
        """Share (n,) of the cycle in the pose; the rest is standing."""
        awake = np.ones_like(phase)
        if self.plan.from_rest:
            awake = awake * smooth_step((phase - self.plan.start) / 0.5)
        if self.plan.to_rest:
            awake = awake * smooth_step((self.plan.end - phase) / 0.5)
        return awake

    def _foot(self, side: str, phase: Array) -> FootTargets:
        prints = self.plan.footprints[side]
        n = len(phase)
        ankle, yaw, pitch, toes = np.zeros((n, 3)), np.zeros(n), np.zeros(n), np.zeros(n)
        for now, following in zip(prints, [*prints[1:], None], strict=True):
            standing = (phase >= now.strike) & (phase <= now.toe_off)
            if np.any(standing):
                at = np.flatnonzero(standing)
                ankle[at], yaw[at], pitch[at], toes[at] = self._standing(side, now, phase[at])
            if following is not None:
                at = np.flatnonzero((phase > now.toe_off) & (phase < following.strike))
                if at.size:
                    ankle[at], yaw[at], pitch[at], toes[at] = self._swing(side, now, following, phase[at])
        return FootTargets(ankle, yaw, pitch, toes)

    def _standing(self, side: str, now: Footprint, phase: Array) -> tuple[Array, Array, Array, Array]:
        curves = self.cycle.feet[side]
        landing, leaving = phase < now.flat, phase > now.heel_off
        pitch, toes = np.zeros_like(phase), np.zeros_like(phase)
        if np.isfinite(now.strike):
            since = phase[landing] - now.strike
            pitch[landing] = now.land * curves.pitch(1.0 + since)
            toes[landing] = now.land * curves.toes_pitch(1.0 + since)
        if np.isfinite(now.toe_off):
            pitch[leaving] = now.lift * curves.pitch(phase[leaving] - now.toe_off + curves.timing.toe_off)
        rolled = rolled_ankle(self.body, pitch, pitch < 0.0)
        x, z = now.place
        ankle = np.stack(
            [x + rolled[:, 1] * np.sin(now.yaw), rolled[:, 0], z + rolled[:, 1] * np.cos(now.yaw)], axis=-1
        )
        return ankle, np.full_like(phase, now.yaw), pitch, toes

    def _swing(
        self, side: str, now: Footprint, following: Footprint, phase: Array
    ) -> tuple[Array, Array, Array, Array]:
        curves = self.cycle.feet[side]
        u = (phase - now.toe_off) / (following.strike - now.toe_off)
        own = curves.timing.toe_off + u * (1.0 - curves.timing.toe_off)
        warp = smooth_step(u)
        scale = now.lift + (following.land - now.lift) * warp
        pitch, toes = scale * curves.pitch(own), scale * curves.toes_pitch(own)
        turn = np.mod(following.yaw - now.yaw + np.pi, 2.0 * np.pi) - np.pi
        travel = curves.travel(own)
        rolled = rolled_ankle(self.body, pitch, ball_share(u, curves.strikes_on_ball))
        facing = now.yaw + turn * warp + curves.yaw(own)
        # The rolling point goes beside the path as it bends, from one footprint to the next, and rests at both.
        arc = now.arc + travel[:, 2] / self.cycle.stride * (following.arc - now.arc)
        aside = now.aside + (following.aside - now.aside) * warp
        point = self.path.offset(arc, aside + travel[:, 0])
        ankle = np.stack(
            [
                point[:, 0] + rolled[:, 1] * np.sin(facing),
                travel[:, 1] + rolled[:, 0],
                point[:, 1] + rolled[:, 1] * np.cos(facing),
            ],
            axis=-1,
        )
        return ankle, facing, pitch, toes_above_floor(self.body, u, ankle[:, 1], pitch, toes)


def walk_along(
    cycle: Cycle,
    path: Path,
    steps: int | None = None,
    *,
    start: bool = True,
    stop: bool = True,
    speeds: list[tuple[float, float]] | None = None,
) -> Walk:
    """A walk of `cycle` along `path`; see `plan_walk` for the steps and `make_clock` for the speeds.

    Raises PathError when the path is too short.
    """
    plan = plan_walk(cycle, path, steps, start=start, stop=stop)
    clock = make_clock(plan.start, plan.end, cycle.period, from_rest=start, to_rest=stop, speeds=speeds)
    return Walk(cycle, path, plan, clock)


def walk_for(cycle: Cycle, path: Path, seconds: float, *, speeds: list[tuple[float, float]] | None = None) -> Walk:
    """The longest walk from standing to standing that takes at most `seconds`. Raises PathError when not even one step
    does, or when the path ends before."""
    if not 0.0 < seconds < np.inf:
        raise PathError(f"a walk lasts more than 0 s, and ends; not {seconds:g} s")
    best: Walk | None = None
    for steps in range(1, 2 + int(2.0 * seconds / (cycle.period * _SLOWEST))):
        if steps * cycle.step > path.length + 1e-6:
            break
        walk = walk_along(cycle, path, steps, speeds=speeds)
        if walk.duration > seconds:
            break
        best = walk
    if best is None:
        raise PathError(f"not one step of {cycle.step:.2f} m fits into {seconds:g} s and {path.length:.2f} m")
    return best


def close_legs(body: Humanoid, times: Array, targets: Targets) -> Motion:
    """Joint rotations that put pelvis and feet where the targets are."""
    rotations = np.tile(rot.IDENTITY, (len(times), len(JOINTS), 1))
    for name, q in targets.joints.items():
        rotations[:, INDEX[name]] = q
    hips_rotation = targets.joints["hips"]
    for side, foot in targets.feet.items():
        leg = close_leg(body, side, targets.hips, hips_rotation, foot.ankle, foot.rotation, foot.yaw)
        for part, q in zip(("UpperLeg", "LowerLeg", "Foot"), leg, strict=True):
            rotations[:, INDEX[side + part]] = q
        toe = foot.toes_pitch - foot.pitch
        rotations[:, INDEX[f"{side}Toes"]] = rot.from_axis_angle([-1.0, 0.0, 0.0], toe)
    # Neighbouring keys keep one sign, or linear interpolation in a viewer would go the long way round.
    for joint in range(rotations.shape[1]):
        rotations[:, joint] = rot.continuous(rotations[:, joint])
    return Motion(times, targets.hips, rotations)


def _interval(edges: tuple[float, float]) -> tuple[float, float] | None:
    return edges if edges[1] > edges[0] else None
