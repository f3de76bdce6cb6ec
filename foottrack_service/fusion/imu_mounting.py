"""How an IMU sits on its shoe, found by use: stand still for three seconds, take one step forward, stand again.

Standing gives up (the specific force) and the gyro's bias; the step gives the foot's lateral axis, about which it
pitches most, and the way it went says which end of that axis is right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array

WINDOW_S = 0.1
STILL_SPREAD = 0.35
"""m/s^2 of specific force within a window, of a foot that stands."""
STILL_RATE = 0.25
"""rad/s; likewise."""
LEAST_STILL_S = 1.0
LEAST_STEP = 0.15
"""m: a shorter one shows no direction."""
LEAST_PITCH = 0.6
"""rad/s RMS about the lateral axis."""
LARGEST_TURN = 0.45
"""rad between the way a foot went and the way it points: more was no step forward."""


class MountingError(Exception):
    """The movement does not show how the sensor sits; the text says what to do.

    ``unfinished``: it may still, with what comes next.
    """

    def __init__(self, text: str, *, unfinished: bool = False) -> None:
        super().__init__(text)
        self.unfinished = unfinished


@dataclass(frozen=True, slots=True)
class Mounting:
    """What one step showed."""

    q: Array
    """Sensor to foot."""
    gyro_bias: Array
    """rad/s, sensor frame; zeros for a device that sends its attitude only."""
    turn: float
    """rad between the step's direction and the toes': how far the two ways to find "forward" disagree."""


def find_mounting(samples: Sequence[ImuSample]) -> Mounting:
    """From samples of standing, one step forward and standing again. Raises MountingError."""
    t = np.array([s.t for s in samples]) * 1e-9
    if len(t) < 20 or t[-1] - t[0] < LEAST_STILL_S:
        raise MountingError(
            "too few samples: stand still for 3 s, take one step forward, and stand again", unfinished=True
        )
    acc, rate = np.array([s.acc for s in samples]), _rates(samples, t)
    still = _still(t, acc, rate)
    moving = np.flatnonzero(~still & (t > t[0] + LEAST_STILL_S))
    if not still[t < t[0] + LEAST_STILL_S].all():
        raise MountingError("the foot did not stand still at first: stand still for 3 s before the step")
    if moving.size == 0:
        raise MountingError("the foot never moved: take one step forward", unfinished=True)
    first = int(moving[0])
    after = np.flatnonzero(still & (np.arange(len(t)) > first) & (t > t[first] + 0.25))
    if after.size == 0:
        raise MountingError("the foot did not come to rest: stand still after the step", unfinished=True)
    last = int(after[0])
    standing = slice(0, max(1, first - 1))
    up = acc[standing].mean(axis=0)
    up /= np.linalg.norm(up)
    bias = rate[standing].mean(axis=0)
    way = _displacement(t[first - 1 : last + 1], acc[first - 1 : last + 1], rate[first - 1 : last + 1] - bias, up)
    way -= up * (way @ up)
    length = float(np.linalg.norm(way))
    if length < LEAST_STEP:
        raise MountingError("the step was too short: take one of at least 30 cm, straight ahead")
    swing = rate[first:last] - bias
    swing = swing - np.outer(swing @ up, up)
    values, vectors = np.linalg.eigh(swing.T @ swing / len(swing))
    if values[-1] < LEAST_PITCH**2:
        raise MountingError("the foot hardly rolled: take one normal step, straight ahead")
    right = vectors[:, -1] - up * (vectors[:, -1] @ up)
    right /= np.linalg.norm(right)
    if np.cross(up, right) @ way < 0.0:
        right = -right
    forward = np.cross(up, right)
    turn = float(np.arccos(np.clip(forward @ way / length, -1.0, 1.0)))
    if turn > LARGEST_TURN:
        raise MountingError("the step did not go where the toes point: take one straight ahead")
    q = rot.from_matrix(np.stack([right, up, -forward]))
    raw = samples[0].gyro is not None
    return Mounting(q, bias if raw else np.zeros(3), turn)


def _rates(samples: Sequence[ImuSample], t: Array) -> Array:
    """(n, 3) rad/s, by the gyro or by the increments of the device's own attitude."""
    if all(s.gyro is not None for s in samples):
        return np.array([s.gyro for s in samples])
    if any(s.q is None for s in samples):
        raise MountingError("samples have neither rates nor attitudes throughout")
    q = rot.normalised(np.array([s.q for s in samples]))
    steps = rot.to_rotation_vector(rot.multiply(rot.conjugate(q[:-1]), q[1:]))
    rates = np.zeros((len(t), 3))
    rates[1:] = steps / np.maximum(np.diff(t), 1e-4)[:, None]
    rates[0] = rates[1]
    return rates


def _still(t: Array, acc: Array, rate: Array) -> npt.NDArray[np.bool_]:
    """(n,) whether the foot stands within half a window of each sample."""
    found = np.zeros(len(t), dtype=np.bool_)
    begin = np.searchsorted(t, t - 0.5 * WINDOW_S)
    end = np.searchsorted(t, t + 0.5 * WINDOW_S, side="right")
    for i, (a, b) in enumerate(zip(begin, end, strict=True)):
        spread = float(np.sqrt(acc[a:b].var(axis=0).sum()))
        found[i] = spread < STILL_SPREAD and float(np.linalg.norm(rate[a:b].mean(axis=0))) < STILL_RATE
    return found


def _displacement(t: Array, acc: Array, rate: Array, up: Array) -> Array:
    """Way of the sensor, m, in its own axes at the start; at rest at both ends, which takes off the drift."""
    q, v = rot.IDENTITY, np.zeros(3)
    speeds = [v]
    for i in range(1, len(t)):
        dt = t[i] - t[i - 1]
        half = rot.multiply(q, rot.from_rotation_vector(0.25 * (rate[i] + rate[i - 1]) * dt))
        v = v + dt * (rot.rotate(half, 0.5 * (acc[i] + acc[i - 1])) - STANDARD_GRAVITY * up)
        q = rot.multiply(q, rot.from_rotation_vector(0.5 * (rate[i] + rate[i - 1]) * dt))
        speeds.append(v)
    track = np.array(speeds)
    track -= np.outer((t - t[0]) / (t[-1] - t[0]), track[-1])
    return np.asarray(np.sum(0.5 * (track[1:] + track[:-1]) * np.diff(t)[:, None], axis=0))
