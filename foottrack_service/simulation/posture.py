"""Where hips and head are, given what the feet do: the person looks down at them and never stretches a leg too far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from foottrack_service import rotations
from foottrack_service.rotations import Array
from foottrack_service.simulation import noise
from foottrack_service.simulation.anatomy import EYES_FROM_NECK, Person
from foottrack_service.simulation.bouts import Bout, Carriage
from foottrack_service.simulation.easing import ease
from foottrack_service.simulation.footsteps import FootSamples
from foottrack_service.simulation.truth import GRID_HZ, Track

_REACH = 0.99
"""Largest share of a leg's length that is used: nobody walks on locked knees."""
_HIPS_AHEAD = 0.03
"""m: standing, the hips are a little before the ankles."""
_SWAY_SHARE = 0.25
"""How much of the way to the standing foot the hips go: about 2 cm to each side in a walk."""

_FARTHEST_LEAN = 0.9
"""Of the trunk's length, the neck before the hips: bent by 64 deg."""

_FADE_S = 0.4
"""From standing to walking, and back: what stands is carried a little differently."""
_LOOK_DOWN = np.radians(60.0)
"""Only so does a camera mounted 20 deg down see the wearer's own feet."""


@dataclass(frozen=True)
class Bearing:
    """How the person carries hips and head. Angles in rad, lengths in m."""

    look_down: Array | float = _LOOK_DOWN
    """The headset's pitch, or what it is on the truth's grid, (n,)."""
    gaze_sd: float = np.radians(2.5)
    gaze_band_hz: float = 0.5
    sway_sd: float = 0.008
    sway_band_hz: float = 0.5
    follow_s: float = 0.14
    """How smoothly the hips follow the feet."""


@dataclass(frozen=True)
class Extra:
    """What the task adds, on the truth's grid: hips down and back, trunk forward (n,) m, head turn (n,) rad."""

    crouch: Array | float = 0.0
    back: Array | float = 0.0
    lean: Array | float = 0.0
    yaw: Array | float = 0.0


def carried(
    left: FootSamples,
    right: FootSamples,
    person: Person,
    bearing: Bearing,
    extra: Extra,
    random: np.random.Generator,
    bouts: Sequence[Bout] = (),
) -> tuple[Track, Track]:
    """Tracks of head and hips over these feet; in `bouts` the walk cycle carries them."""
    t = left.t
    n = len(t)
    yaw = _smooth(0.5 * (left.yaw + right.yaw), 0.3)
    facing = rotations.from_yaw(yaw)
    hips = _hips(left, right, facing, bearing, person)
    sway = noise.wander(random, n, GRID_HZ, bearing.sway_band_hz, bearing.sway_sd)
    hips += sway * [1.0, 0.0, 1.0]
    hips += np.asarray(extra.back)[..., None] * rotations.rotate(facing, [0.0, 0.0, 1.0])
    standing = person.hip_height - np.asarray(extra.crouch) + 0.1 * (sway[:, 1] - 2.0 * bearing.sway_sd)
    hips[:, 1] = _height(hips, left, right, facing, person, standing)

    lean = np.broadcast_to(np.asarray(extra.lean, dtype=np.float64), n)
    # A child's trunk is shorter than some tasks lean an adult's forward.
    lean = lean * min(1.0, _FARTHEST_LEAN * person.neck_above_hips / max(float(np.max(np.abs(lean))), 1e-9))
    drop = person.neck_above_hips - np.sqrt(person.neck_above_hips**2 - lean**2)
    towards = rotations.from_yaw(yaw + np.asarray(extra.yaw))
    neck = hips + rotations.rotate(towards, np.stack([np.zeros(n), -drop, -lean], axis=-1))
    neck[:, 1] += person.neck_above_hips
    for bout in bouts:
        share = ease((t - bout.start + _FADE_S) / _FADE_S) * ease((bout.end + _FADE_S - t) / _FADE_S)
        here = share > 0.0
        walks, part = _calmed(bout.carriage(t[here])), share[here]
        hips[here] += part[:, None] * (walks.hips - hips[here])
        neck[here] += part[:, None] * (walks.neck + sway[here] * [1.0, 0.0, 1.0] - neck[here])
        facing[here] = rotations.slerp(facing[here], walks.hips_q, part)
        towards[here] = rotations.slerp(towards[here], walks.head_q, part)

    gaze = noise.wander(random, n, GRID_HZ, bearing.gaze_band_hz, bearing.gaze_sd)
    looking = rotations.multiply(
        rotations.from_yaw(gaze[:, 1]),
        rotations.multiply(
            rotations.from_axis_angle([1.0, 0.0, 0.0], gaze[:, 0] - bearing.look_down),
            rotations.from_axis_angle([0.0, 0.0, 1.0], 0.5 * gaze[:, 2]),
        ),
    )
    head_q = rotations.multiply(towards, looking)
    head = neck + rotations.rotate(head_q, EYES_FROM_NECK)
    return Track(t, head, head_q), Track(t, hips, facing)


def _calmed(walks: Carriage) -> Carriage:
    """A key-framed pelvis drops and surges harder than a body of 70 kg can: the same below it, and smoothly."""
    hips = _smooth(walks.hips, 0.04)
    hips[:, 1] = _smooth(minimum_filter1d(walks.hips[:, 1], round(0.12 * GRID_HZ)), 0.04)
    return replace(walks, hips=hips, neck=walks.neck + hips - walks.hips)


def _hips(left: FootSamples, right: FootSamples, facing: Array, bearing: Bearing, person: Person) -> Array:
    middle = 0.5 * (left.p + right.p)
    stands = [(foot.heel | foot.toe).astype(np.float64) for foot in (left, right)]
    lateral = 0.5 * (right.p - left.p) * (stands[1] - stands[0])[:, None]
    middle = middle + rotations.rotate(facing, [0.0, 0.0, -_HIPS_AHEAD]) + _SWAY_SHARE * lateral
    return _smooth(middle, bearing.follow_s)


def _height(
    hips: Array, left: FootSamples, right: FootSamples, facing: Array, person: Person, standing: Array
) -> Array:
    limits = [np.broadcast_to(standing, len(hips))]
    for foot, side in ((left, -0.5), (right, 0.5)):
        joint = hips + rotations.rotate(facing, [side * person.hip_spacing, 0.0, 0.0])
        flat = np.sum((joint - foot.p)[:, [0, 2]] ** 2, axis=-1)
        limits.append(foot.p[:, 1] + np.sqrt(np.maximum((_REACH * person.leg) ** 2 - flat, 0.04)))
    lowest = minimum_filter1d(np.min(limits, axis=0), round(0.12 * GRID_HZ))
    return _smooth(lowest, 0.04)


def _smooth(x: Array, sigma_s: float) -> Array:
    smoothed: Array = gaussian_filter1d(x, sigma_s * GRID_HZ, axis=0, mode="nearest")
    return smoothed
