"""How a foot rolls over the floor, and how it gets from one footprint to the next.

A *footprint* is where a foot stands flat: the floor below its ankle, and its yaw. While it is planted, the
foot's pitch alone says where the ankle is: toes up, it turns about the heel; toes down, about the ball, with
the toes flat on the floor. In swing, the *travel* of the point it rolls on (the ball when it leaves, the heel
when it lands) is at rest at both ends, so nothing slips however the pitch is scaled or the footprints moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_service.walkcycle.curves import Curve, at_rest, smooth_step
from foottrack_service.walkcycle.errors import WalkError
from foottrack_service.walkcycle.project import ContactTiming
from foottrack_service.walkcycle.skeleton import Humanoid

Array = npt.NDArray[np.float64]

_PENETRATION_M = 2e-4
"""Depth under the floor that is left alone in swing: below what anybody sees, and half of what is promised."""
_CLEARANCE_M = 0.004
"""Least height of a foot in swing, at 1.75 m: between two keys of a file it sinks by half a millimetre."""
_GRID = np.linspace(0.0, 1.0, 201)


def turned(pitch: npt.ArrayLike, height: float, forward: float) -> Array:
    """A sagittal point (up, forward) of the foot after it pitched its toes up, (n, 2)."""
    c, s = np.cos(pitch), np.sin(pitch)
    return np.stack([height * c + forward * s, forward * c - height * s], axis=-1)


def rolled_ankle(body: Humanoid, pitch: npt.ArrayLike, ball_share: npt.ArrayLike) -> Array:
    """Ankle (up, forward), (n, 2) m, relative to the footprint, of a foot that stands on its ball (share 1) or
    heel (share 0)."""
    heel, ball = body.heel, body.ball
    on_heel = np.array([0.0, heel[2]]) + turned(pitch, -heel[1], -heel[2])
    on_ball = np.array([body.ball_height, ball[2]]) + turned(pitch, -ball[1], -ball[2])
    share = np.asarray(ball_share, dtype=np.float64)[..., None]
    return np.asarray(share * on_ball + (1.0 - share) * on_heel)


def ball_share(swing: Array, strikes_on_ball: bool) -> Array:
    """What a foot rolls on over its swing (share (n,)): 1 the ball that it leaves with, 0 the heel that it lands on."""
    return np.ones_like(swing) if strikes_on_ball else 1.0 - smooth_step(swing)


def planted_ankle(body: Humanoid, pitch: npt.ArrayLike) -> Array:
    """Ankle (up, forward), (n, 2) m, of a planted foot: over the ball with the toes down, else over the heel."""
    return rolled_ankle(body, pitch, np.asarray(pitch) < 0.0)


def lowest_point(body: Humanoid, ankle_height: Array, pitch: Array, toes_pitch: Array) -> Array:
    """Height of the lowest of heel, ball and toe tip above the floor, (n,) m. `toes_pitch` is the toes' pitch
    against the floor."""
    heel = turned(pitch, body.heel[1], body.heel[2])[..., 0]
    ball = turned(pitch, body.ball[1], body.ball[2])[..., 0]
    tip = turned(toes_pitch, body.toe_tip[1], body.toe_tip[2])[..., 0]
    return np.asarray(ankle_height + np.minimum(heel, np.minimum(ball - body.ball_height, ball + tip)))


def toes_above_floor(body: Humanoid, swing: Array, ankle_height: Array, pitch: Array, toes_pitch: Array) -> Array:
    """The toes' pitch (n,) rad over a swing (share (n,)), bent up where they would come too near to the floor."""
    ball = (
        ankle_height - _CLEARANCE_M * body.scale * _raising(swing) + turned(pitch, body.ball[1], body.ball[2])[..., 0]
    )
    length = float(np.hypot(body.toe_tip[1], body.toe_tip[2]))
    slope = float(np.arctan2(-body.toe_tip[1], body.toe_tip[2]))
    return np.asarray(np.maximum(toes_pitch, slope - np.arcsin(np.clip(ball / length, -1.0, 1.0))))


@dataclass(frozen=True)
class FootCurves:
    """One foot over its own cycle, phase 0 at its strike.

    `pitch` and `toes_pitch` (against the floor) in rad over phases [heel_off, 1 + flat], zero outside; `travel`
    (phase) -> (n, 3) m: x, y, z of the rolling point against the footprint that is left, straight ahead, at the
    nominal stride; `yaw` deviation in swing, rad.
    """

    timing: ContactTiming
    strikes_on_ball: bool
    pitch: Curve
    toes_pitch: Curve
    travel: Curve
    yaw: Curve


@dataclass(frozen=True)
class FootKeys:
    """What the poses say of one foot: phases (k,) in [0, 1) since its strike, ankle (k, 3) m in the world of a
    straight walk (footprint at the origin for phase 0, the stride ahead for phase 1), and angles (k,) rad."""

    phases: Array
    ankle: Array
    pitch: Array
    toe: Array
    yaw: Array


def foot_curves(body: Humanoid, timing: ContactTiming, keys: FootKeys, stride: float) -> FootCurves:
    """Curves of one foot through its keys. `keys.ankle` is only used in swing: planted feet are planted.

    Raises WalkError where the swing would have to be lifted by more than a third of the shank to clear the floor.
    """
    off, end = timing.heel_off, 1.0 + timing.flat
    phases = np.where(keys.phases < off, keys.phases + 1.0, keys.phases)
    order = np.argsort(phases)
    phases, pitch, toe = phases[order], keys.pitch[order], keys.toe[order]
    ankle, yaw = keys.ankle[order], keys.yaw[order]

    def through(
        start: float, stop: float, values: Array, ends: tuple[float | Array, float | Array], apart: float = 0.03
    ) -> Curve:
        # A key next to a boundary only bends the curve: the boundary itself is the better word there.
        inside = (phases > start + apart) & (phases < stop - apart)
        knots = np.concatenate([[start], phases[inside], [stop]])
        return at_rest(knots, np.concatenate([[ends[0]], values[inside], [ends[1]]]))

    raw_pitch = through(off, end, pitch, (0.0, 0.0))
    strikes_on_ball = bool(raw_pitch(np.array([1.0]))[0] < -1e-3)
    landing = -1.0 if strikes_on_ball else 1.0

    def rolling_pitch(phase: Array) -> Array:
        value = raw_pitch(phase)
        # A spline's overshoot must not turn a roll over the ball into one over the heel.
        value = np.where(phase < timing.toe_off, np.minimum(value, 0.0), value)
        return np.where(phase > 1.0, landing * np.maximum(landing * value, 0.0), value)

    land = 1.0 if strikes_on_ball else end
    toes_pitch = through(timing.toe_off, land, toe + pitch, (0.0, 0.0))
    yaw_curve = through(timing.toe_off, 1.0, yaw, (0.0, 0.0))

    swing = (phases - timing.toe_off) / (1.0 - timing.toe_off)
    rolled = rolled_ankle(body, pitch, ball_share(swing, strikes_on_ball))
    travelled = ankle - np.stack([np.zeros_like(swing), rolled[:, 0], rolled[:, 1]], axis=-1)
    # What lands fast slips between the keys of a file: over the floor, the last of the way belongs to the landing.
    gone = np.array([0.0, stride])
    level = through(timing.toe_off, 1.0, travelled[:, [0, 2]], (np.zeros(2), gone), apart=0.065)
    rise = through(timing.toe_off, 1.0, travelled[:, 1], (0.0, 0.0))

    def travel(phase: Array) -> Array:
        return np.insert(level(phase), 1, rise(phase), axis=-1)

    grid = timing.toe_off + _GRID * (1.0 - timing.toe_off)
    height = travel(grid)[:, 1] + rolled_ankle(body, rolling_pitch(grid), ball_share(_GRID, strikes_on_ball))[:, 0]
    toes = toes_above_floor(body, _GRID, height, rolling_pitch(grid), toes_pitch(grid))
    bump = _raising(_GRID)
    clearance = _CLEARANCE_M * body.scale * bump
    depth = clearance - lowest_point(body, height, rolling_pitch(grid), toes) - _PENETRATION_M
    lift = float(np.max(np.where(depth > 0.0, depth / np.maximum(bump, 1e-9), 0.0)))
    if lift > body.shank / 3.0:
        worst = float(grid[np.argmax(depth)])
        raise WalkError(
            f"the foot passes {1e3 * float(depth.max()):.0f} mm under the floor at phase {worst:.2f} after its strike"
        )

    def lifted(phase: Array) -> Array:
        u = np.clip((phase - timing.toe_off) / (1.0 - timing.toe_off), 0.0, 1.0)
        raised = travel(phase)
        raised[..., 1] += lift * _raising(u)
        return raised

    return FootCurves(timing, strikes_on_ball, rolling_pitch, toes_pitch, lifted, yaw_curve)


def _raising(swing: Array) -> Array:
    """How much of a lift a swing has, 0 to 1: all of it but for its beginning and end."""
    return smooth_step(swing / 0.2) * smooth_step((1.0 - swing) / 0.2)
