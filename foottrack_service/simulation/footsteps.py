"""One foot's motion from a plan of steps.

In stance a foot turns without slipping: about the heel after the strike, not at all while it is flat, over the ball and
the toes after the heel has left. In between the ankle flies on quintics whose ends have the position, velocity and
acceleration of the turning foot, so the specific force is continuous throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BPoly

from foottrack_service import rotations
from foottrack_service.rotations import Array
from foottrack_service.simulation.anatomy import Sole
from foottrack_service.simulation.easing import ease
from foottrack_service.simulation.rocker import rocker
from foottrack_service.simulation.truth import Flags


class Place(NamedTuple):
    """Where a foot stands flat: the ankle's x, z [m, stage] and the toes' heading [rad, positive to the left]."""

    x: float
    z: float
    yaw: float

    def ahead(self, forward: float, right: float = 0.0, turn: float = 0.0) -> Place:
        """A place relative to this one and its heading, m and rad."""
        sine, cosine = np.sin(self.yaw), np.cos(self.yaw)
        return Place(
            self.x - forward * sine + right * cosine, self.z - forward * cosine - right * sine, self.yaw + turn
        )


@dataclass(frozen=True)
class Style:
    """How a foot is moved. Pitches are positive with the heel above the toes."""

    swing: float
    """Toe-off to strike, s."""
    roll: float
    """Heel-off to toe-off, s."""
    settle: float
    """Strike to flat, s."""
    toe_off_pitch: float
    """rad."""
    toe_off_rate: float
    """rad/s."""
    strike_pitch: float
    """rad, negative: the heel lands first."""
    lift: float
    """m above the shortest smooth way of the ankle, at mid swing."""


@dataclass(frozen=True)
class Step:
    """One step of one foot: toe-off at `start`, s."""

    start: float
    place: Place
    style: Style

    @property
    def heel_off(self) -> float:
        """s."""
        return self.start - self.style.roll

    @property
    def strike(self) -> float:
        """s."""
        return self.start + self.style.swing

    @property
    def flat(self) -> float:
        """s."""
        return self.strike + self.style.settle


class Moment(NamedTuple):
    """One foot at instants (n,): ankle (n, 3) m, yaw and pitch (n,) rad as in `FootSamples`, and whether
    heel and forefoot stand (n,)."""

    p: Array
    yaw: Array
    pitch: Array
    heel: Flags
    toe: Flags


@dataclass(frozen=True)
class Strides:
    """Many steps of one foot that something else moves, from standing at one place to standing at another."""

    heel_off: float
    """s."""
    flat: float
    """s."""
    place: Place
    """Where the foot stands at last."""
    strikes: Array
    flats: Array
    at: Callable[[Array], Moment]
    """What the foot does at instants from `heel_off` to `flat`, (n,) s."""


@dataclass
class FootSamples:
    """A foot on the truth's grid, before it becomes a track."""

    t: Array
    p: Array
    """(n, 3) ankle, m."""
    yaw: Array
    """(n,) rad, unwrapped."""
    pitch: Array
    """(n,) rad, heel up."""
    heel: Flags
    toe: Flags
    strikes: Array
    flats: Array

    @property
    def q(self) -> Array:
        """(n, 4) foot to stage."""
        return rotations.multiply(rotations.from_yaw(self.yaw), rotations.from_axis_angle([1.0, 0.0, 0.0], -self.pitch))


def standing(t: Array, place: Place, sole: Sole) -> FootSamples:
    """A foot that stands flat throughout."""
    n = len(t)
    still = np.ones(n, dtype=np.bool_)
    p = np.tile([place.x, sole.ankle_height, place.z], (n, 1))
    none = np.empty(0)
    return FootSamples(t, p, np.full(n, place.yaw), np.zeros(n), still, still.copy(), none, none)


def stepping(t: Array, place: Place, steps: Sequence[Step | Strides], sole: Sole) -> FootSamples:
    """A foot that stands at `place` and takes `steps` on times `t` (n,), s.

    Raises ValueError when a step's heel rises before the last one is flat.
    """
    foot = standing(t, place, sole)
    last = -np.inf
    for step in steps:
        if step.heel_off < last:
            raise ValueError(f"the heel rises at {step.heel_off:.3f} s, before the foot is flat at {last:.3f} s")
        if isinstance(step, Strides):
            _follow(foot, step, sole)
        else:
            _take(foot, place, step, sole)
        place, last = step.place, step.flat
    foot.strikes = np.concatenate([s.strikes if isinstance(s, Strides) else [s.strike] for s in steps] or [[]])
    foot.flats = np.concatenate([s.flats if isinstance(s, Strides) else [s.flat] for s in steps] or [[]])
    return foot


def _follow(foot: FootSamples, strides: Strides, sole: Sole) -> None:
    during = (foot.t >= strides.heel_off) & (foot.t < strides.flat)
    moment = strides.at(foot.t[during])
    foot.p[during], foot.yaw[during], foot.pitch[during] = moment.p, moment.yaw, moment.pitch
    foot.heel[during], foot.toe[during] = moment.heel, moment.toe
    after, place = foot.t >= strides.flat, strides.place
    foot.p[after], foot.yaw[after] = [place.x, sole.ankle_height, place.z], place.yaw


def _take(foot: FootSamples, old: Place, step: Step, sole: Sole) -> None:
    style, new, t = step.style, step.place, foot.t
    off, on = np.array([style.toe_off_pitch, style.toe_off_rate, 0.0]), np.array([style.strike_pitch, 0.0, 0.0])
    instants = [step.heel_off, step.start, step.strike, step.flat]
    pitch = BPoly.from_derivatives(instants, [(0.0, 0.0, 0.0), off, on, (0.0, 0.0, 0.0)])
    rolls = (t >= step.heel_off) & (t < step.start)
    flies = (t >= step.start) & (t < step.strike)
    lands = (t >= step.strike) & (t < step.flat)
    moves = rolls | flies | lands
    foot.pitch[moves] = pitch(t[moves])

    toes = rocker(sole)
    forward, up = toes.ankle(foot.pitch[rolls])
    foot.p[rolls] = _in_stage(old, np.stack([forward + sole.ball_z, up], axis=-1))
    forward, up = _over_heel(sole, foot.pitch[lands])
    foot.p[lands] = _in_stage(new, np.stack([forward - sole.heel_z, up], axis=-1))

    take_off = _turning(toes.ankle(off[0]), toes.contact(off[0]), toes.radius(off[0]), off)
    touch_down = _turning(_over_heel(sole, on[0]), (-sole.heel_z, sole.ankle_height), 0.0, on)
    take_off[0] += [sole.ball_z, 0.0]
    touch_down[0] += [-sole.heel_z, 0.0]
    ends = np.array(
        [
            [_in_stage(old, take_off[0]), *(_direction(old, d) for d in take_off[1:])],
            [_in_stage(new, touch_down[0]), *(_direction(new, d) for d in touch_down[1:])],
        ]
    )
    way = BPoly.from_derivatives([step.start, step.strike], ends)
    share = (t[flies] - step.start) / style.swing
    foot.p[flies] = way(t[flies])
    foot.p[flies, 1] += style.lift * (4.0 * share * (1.0 - share)) ** 3
    foot.yaw[flies] = old.yaw + (new.yaw - old.yaw) * ease(share)
    after = t >= step.strike
    foot.yaw[after] = new.yaw
    foot.p[t >= step.flat] = [new.x, sole.ankle_height, new.z]

    foot.heel[(t >= step.heel_off) & (t < step.strike)] = False
    foot.toe[(t >= step.start) & (t < step.flat)] = False


def _over_heel(sole: Sole, pitch: Array) -> tuple[Array, Array]:
    """The ankle's forward and up from the heel on the floor, m."""
    sine, cosine = np.sin(pitch), np.cos(pitch)
    return sole.ankle_height * sine + sole.heel_z * cosine, sole.ankle_height * cosine - sole.heel_z * sine


def _turning(ankle: tuple[Any, Any], contact: tuple[Any, Any], radius: float, pitch: Array) -> Array:
    """(3, 2): the ankle's forward and up, and their derivatives, on a sole that rolls with `pitch` (angle and its two
    derivatives) about a contact (ahead, below: foot frame, m)."""
    (forward, up), (angle, rate, acceleration) = ankle, pitch
    from_contact = contact[1] * np.sin(angle) - contact[0] * np.cos(angle)
    tangent = np.array([up, -from_contact])
    bend = np.array([-from_contact, radius - up])
    return np.array([[forward, up], tangent * rate, tangent * acceleration + bend * rate**2])


def _in_stage(place: Place, forward_up: Array) -> Array:
    return np.asarray(_direction(place, forward_up) + np.array([place.x, 0.0, place.z]))


def _direction(place: Place, forward_up: Array) -> Array:
    forward, up = forward_up[..., 0], forward_up[..., 1]
    return np.stack([-forward * np.sin(place.yaw), up, -forward * np.cos(place.yaw)], axis=-1)
