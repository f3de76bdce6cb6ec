"""IMU samples as rows of the timeline, and the attitude that a filter begins with."""

from __future__ import annotations

import math

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.fusion.foot_filter_events import ACC, CLIPPED, GYRO, IMU, KIND, MEAN_RATE, UP, WANDER
from foottrack_service.fusion.foot_filter_kernel import GRAVITY, NE, NX
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array

MOST_RATE = 40.0
"""rad/s: increments of a device's q that are faster are its own corrections, not the foot."""
FULL_SCALES = (39.2266, 78.4532, 156.9064)
"""m/s^2 at which accelerometers end: 4, 8, 16 g."""
STUCK_ABOVE = 11.0
"""m/s^2: an axis that gives the same bits beyond this three times is at its end, wherever that is."""
LEAST_FORCE = 1.0
"""m/s^2: a sensor in free fall does not know where up is."""
DEVICE_TILT = 0.02
"""rad/sqrt(s) by which the tilt of a device's own q wanders while it moves: 1.1 deg that change within 2 s."""
FULL_EFFORT = 3.0
"""m/s^2 beyond gravity at which all of that is there."""
EFFORT_MEMORY_S = 2.0
"""A device that was moved levels itself again afterwards: its tilt goes on wandering in the stance."""
ACC_BIAS = 0.15
"""m/s^2 per axis: data sheets allow 0.17 to 0.2. Who believes less never learns it, and loses
centimetres in a swing."""
_UP = np.array([0.0, 1.0, 0.0])


def usable(sample: ImuSample) -> bool:
    """Whether all numbers are finite and there is a rate or an attitude."""
    if sample.gyro is None and sample.q is None:
        return False
    # A sum of squares is finite only where all its parts are.
    total = float(sample.acc @ sample.acc)
    if sample.gyro is not None:
        total += float(sample.gyro @ sample.gyro)
    size = 1.0 if sample.q is None else float(sample.q @ sample.q)
    return math.isfinite(total + size) and size > 0.0


def upright(sample: ImuSample) -> Array | None:
    """Sensor to a frame with +Y up: the device's own attitude, else what the specific force says; None in free fall."""
    if sample.q is not None:
        return rot.normalised(sample.q)
    norm = float(np.linalg.norm(sample.acc))
    if norm < LEAST_FORCE:
        return None
    axis = np.cross(sample.acc / norm, _UP)
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, float(sample.acc[1]) / norm)
    return rot.from_rotation_vector(axis / sine * angle if sine > 1e-9 else np.array([angle, 0.0, 0.0]))


def first_state(q: Array, p: Array, sample: ImuSample) -> tuple[Array, Array]:
    """State (17,) and covariance (16, 16) of a foot that stands with its sensor at ``p``, m, and attitude ``q``."""
    x, P = np.zeros(NX), np.zeros((NE, NE))
    x[0:3], x[6:10] = p, q
    tilt, bias = (0.03, 1e-7) if sample.gyro is None else (0.05, 0.01)
    sigmas = [0.03] * 3 + [0.1] * 3 + [tilt, 0.02, tilt] + [ACC_BIAS] * 3 + [bias] * 3 + [0.005]
    P[np.arange(NE), np.arange(NE)] = np.square(sigmas)
    return x, P


class SampleRows:
    """Turns samples into rows, in order."""

    def __init__(self) -> None:
        self._q: Array | None = None
        self._effort = 0.0
        self._acc: tuple[Array, Array] = (np.zeros(3), np.ones(3))

    def forget(self) -> None:
        """The next sample does not follow the last one."""
        self._q = None

    def fill(self, row: Array, sample: ImuSample, dt: float) -> None:
        """Write a sample that comes ``dt`` s after the last one into ``row``."""
        row[KIND] = IMU
        row[ACC : ACC + 3] = sample.acc
        size = np.abs(sample.acc)
        last, before = self._acc
        stuck = bool(np.any((size > STUCK_ABOVE) & (sample.acc == last) & (sample.acc == before)))
        largest = float(size.max())
        row[CLIPPED] = float(stuck or any(0.985 < largest / scale < 1.02 for scale in FULL_SCALES))
        self._acc = (sample.acc, last)
        q = None if sample.q is None else rot.normalised(sample.q)
        if q is not None:
            row[UP : UP + 3] = rot.unrotate(q, _UP)
        if sample.gyro is not None:
            row[GYRO : GYRO + 3] = sample.gyro
        else:
            row[MEAN_RATE] = 1.0
            if q is not None:
                felt = float(np.linalg.norm(sample.acc - GRAVITY * row[UP : UP + 3]))
                self._effort = max(self._effort * math.exp(-dt / EFFORT_MEMORY_S), min(1.0, felt / FULL_EFFORT))
                row[WANDER] = DEVICE_TILT * self._effort
            if q is not None and self._q is not None and dt > 0.0:
                rate = rot.to_rotation_vector(rot.multiply(rot.conjugate(self._q), q)) / dt
                if float(rate @ rate) < MOST_RATE**2:
                    row[GYRO : GYRO + 3] = rate
        self._q = q
