"""The technical bench of [B]: headset and trackers on stands or in a hand, nobody wears them.

The trackers lie on the floor before the headset, which looks down at them from 1.5 m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.config import Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation import noise
from foottrack_service.simulation.anatomy import sole
from foottrack_service.simulation.easing import ease
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.truth import GRID_HZ, FootTrack, Track, Truth, grid

_HEAD = np.array([0.0, 1.5, 0.0])  # m: [B]'s stand
_HEAD_PITCH = math.radians(-55.0)  # the camera, 20 deg lower, then looks 75 deg down
_AHEAD = 0.25  # m, the trackers before the headset
_APART = 0.15  # m, each to its side
_REACH = 0.25  # m, how far things are moved
_HAND_SWAY = 0.003  # m SD: no hand is as still as a floor
_STILL_S = 3.0  # at the start, so that filters can settle


def still(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Nothing moves."""
    t = grid(seconds)
    none = np.zeros((len(t), 3))
    return _scene(t, seconds, settings, none, none, none, none)


def tracker_moving(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Trackers in a hand: left, right, forwards, back, up, down, a circle; headset fixed."""
    t = grid(seconds)
    path = _tour(t, seconds, random, _REACH)
    # A hand holds the tracker above the floor and never quite level.
    path[:, 1] += _REACH * 1.2 * ease((t - 1.0) / 1.5)
    held = ease((t - 1.0) / 1.5)[:, None]
    path += held * noise.wander(random, len(t), GRID_HZ, 1.5, _HAND_SWAY)
    tilt = held * noise.wander(random, len(t), GRID_HZ, 0.8, np.radians([5.0, 6.0, 5.0]))
    return _scene(t, seconds, settings, path, tilt, np.zeros_like(path), np.zeros_like(path))


def head_bench(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """The headset is moved the same ways and turned a little; trackers fixed."""
    t = grid(seconds)
    path = _tour(t, seconds, random, 0.6 * _REACH)
    moves = ease((t - 1.0) / 1.5)[:, None]
    tilt = moves * noise.wander(random, len(t), GRID_HZ, 0.5, np.radians([2.5, 4.0, 2.0]))
    none = np.zeros_like(path)
    return _scene(t, seconds, settings, none, none, path, tilt)


def sudden_move(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Trackers lie still and are flicked aside by 0.2 to 0.35 m in 0.15 to 0.25 s, every 2 to 3 s."""
    t = grid(seconds)
    path = np.zeros((len(t), 3))
    side, start = 1.0, _STILL_S
    at = np.zeros(3)
    while start + 1.0 < seconds:
        target = np.array([side * random.uniform(0.1, 0.18), 0.0, random.uniform(-0.12, 0.12)])
        path += (target - at) * ease((t - start) / random.uniform(0.15, 0.25))[:, None]
        at, side, start = target, -side, start + random.uniform(2.0, 3.0)
    none = np.zeros_like(path)
    return _scene(t, seconds, settings, path, none, none, none)


def _tour(t: Array, seconds: float, random: np.random.Generator, reach: float) -> Array:
    """(n, 3) m: to each of six directions and back, then a circle, over and over."""
    path = np.zeros((len(t), 3))
    directions: Sequence[tuple[float, float, float]] = (
        (-1, 0, 0), (1, 0, 0), (0, 0, -1), (0, 0, 1), (0, 1, 0), (0, -1, 0),
    )  # fmt: skip
    start = _STILL_S
    while start < seconds:
        for direction in directions:
            out, back = random.uniform(0.5, 0.9, 2)
            if start + out + back > seconds:
                return path
            way = reach * random.uniform(0.8, 1.0) * np.array(direction)
            path += way * (ease((t - start) / out) - ease((t - start - out) / back))[:, None]
            start += out + back + random.uniform(0.1, 0.4)
        period = random.uniform(2.5, 3.5)
        if start + period > seconds:
            return path
        angle = 2.0 * math.pi * ease((t - start) / period)
        path += 0.6 * reach * np.stack([np.sin(angle), np.zeros_like(t), np.cos(angle) - 1.0], axis=-1)
        start += period + random.uniform(0.3, 0.8)
    return path


def _scene(
    t: Array, seconds: float, settings: Settings, path: Array, tilt: Array, head_path: Array, head_tilt: Array
) -> Truth:
    looking = rotations.from_axis_angle([1.0, 0.0, 0.0], _HEAD_PITCH)
    head = Track(t, _HEAD + head_path, rotations.multiply(rotations.from_rotation_vector(head_tilt), looking))
    feet: dict[Side, FootTrack] = {}
    sides: tuple[tuple[Side, float], ...] = (("left", -_APART), ("right", _APART))
    lies = np.all(path == 0.0, axis=-1) & np.all(tilt == 0.0, axis=-1)
    for side, x in sides:
        base = sole(settings.feet.of(side))
        rest = np.array([x, base.ankle_height, -_AHEAD + 0.15])
        feet[side] = FootTrack(
            t,
            rest + path,
            rotations.from_rotation_vector(tilt),
            heel=lies,
            toe=lies.copy(),
            heel_point=base.heel,
            ball_point=base.ball,
        )
    return Truth(seconds, head, feet)
