"""What an IMU reads when nothing happens: biases, from the times when a foot stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_protocol.frames import STANDARD_GRAVITY

Array = npt.NDArray[np.float64]

LEAST_REST_S = 1.0
MAX_HOLE_S = 0.25
"""Between two samples: what the foot did meanwhile is not known."""
MAX_GYRO_SPREAD = 0.02
"""rad/s, rms about the mean: a sensor in a hand has ten times as much."""
MAX_ACC_SPREAD = 0.15
"""m/s^2, rms about the mean."""
MAX_GYRO_BIAS = 0.2
"""rad/s: the worst chips have 10 deg/s; more is a turn."""
MAX_ACC_BIAS = 1.0
"""m/s^2: more is another fault, such as a wrong range."""
LEAST_SPREAD_OF_POSITIONS = 0.25
"""Least singular value of the positions' directions: below, an axis of the bias is guessed."""


class NotAtRest(ValueError):
    """The sensor moved, or was not watched long enough; the text says what to do."""


class BadPositions(ValueError):
    """The positions cannot tell the bias; the text says what is missing."""


@dataclass(frozen=True)
class Rest:
    """Means over a time of rest, shape (3,): specific force [m/s^2] and, where there is a gyro, rate [rad/s]."""

    acc: Array
    gyro: Array | None
    seconds: float

    @property
    def acc_bias_along_gravity(self) -> Array:
        """m/s^2, shape (3,): all of the accelerometer's bias that one position shows. See ``acc_bias``."""
        norm = np.linalg.norm(self.acc)
        return np.asarray(self.acc * (1.0 - STANDARD_GRAVITY / norm))


def rest(t: npt.ArrayLike, acc: npt.ArrayLike, gyro: npt.ArrayLike | None) -> Rest:
    """A time of rest: stamps [s], shape (n,), acc [m/s^2] and gyro [rad/s], shape (n, 3). Raises NotAtRest."""
    t, acc = np.asarray(t, dtype=np.float64), np.asarray(acc, dtype=np.float64)
    seconds = float(t[-1] - t[0]) if len(t) > 1 else 0.0
    if seconds < LEAST_REST_S:
        raise NotAtRest(f"only {seconds:.1f} s were seen, {LEAST_REST_S:g} are needed: is the sensor on?")
    hole = float(np.max(np.diff(t)))
    if hole > MAX_HOLE_S:
        raise NotAtRest(f"nothing came for {hole:.1f} s: look at the sensor's cable or radio")
    if not np.all(np.isfinite(acc)):
        raise NotAtRest("an acceleration is not finite")
    spread = _spread(acc)
    if spread > MAX_ACC_SPREAD:
        raise NotAtRest(f"the acceleration varies by {spread:.2f} m/s^2: keep the foot still")
    off = abs(float(np.linalg.norm(acc.mean(axis=0))) - STANDARD_GRAVITY)
    if off > MAX_ACC_BIAS:
        raise NotAtRest(f"gravity is off by {off:.2f} m/s^2: the accelerometer's range or unit is wrong")
    if gyro is None:
        return Rest(acc.mean(axis=0), None, seconds)
    gyro = np.asarray(gyro, dtype=np.float64)
    spread = _spread(gyro)
    if not spread <= MAX_GYRO_SPREAD:
        raise NotAtRest(f"the rate varies by {spread:.3f} rad/s: keep the foot still")
    mean = gyro.mean(axis=0)
    if float(np.linalg.norm(mean)) > MAX_GYRO_BIAS:
        raise NotAtRest(f"the sensor turns by {float(np.linalg.norm(mean)):.2f} rad/s: keep the foot still")
    return Rest(acc.mean(axis=0), mean, seconds)


def acc_bias(positions: npt.ArrayLike) -> Array:
    """The accelerometer's bias [m/s^2], shape (3,), from its means at rest in several positions, shape (n, 3).

    The bias b with |a - b| = g in all of them, by Gauss-Newton; six positions, each side down once, are best. Raises
    BadPositions where there are fewer than four or too similar ones, or what comes out cannot be a bias.
    """
    a = np.asarray(positions, dtype=np.float64)
    if len(a) < 4:
        raise BadPositions(f"{len(a)} positions, at least 4 are needed")
    directions = a / np.linalg.norm(a, axis=1, keepdims=True)
    differing = np.linalg.svd(directions - directions.mean(axis=0), compute_uv=False)[-1] / np.sqrt(len(a))
    if differing < LEAST_SPREAD_OF_POSITIONS:
        raise BadPositions("the positions are too alike: put the sensor down on each of its sides")
    bias = np.zeros(3)
    for _ in range(20):
        from_bias = a - bias
        norm = np.linalg.norm(from_bias, axis=1)
        step = np.linalg.lstsq(from_bias / norm[:, None], norm - STANDARD_GRAVITY, rcond=None)[0]
        bias = bias + step
        if float(np.linalg.norm(step)) < 1e-9:
            break
    if not float(np.linalg.norm(bias)) <= MAX_ACC_BIAS:
        raise BadPositions(f"a bias of {float(np.linalg.norm(bias)):.2f} m/s^2 cannot be: was the sensor still?")
    return bias


def _spread(samples: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((samples - samples.mean(axis=0)) ** 2, axis=1))))
