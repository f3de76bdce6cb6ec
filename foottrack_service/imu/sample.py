"""What an IMU says, before it is put on the wire."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import Counter
from typing import NamedTuple

from foottrack_protocol.frames import STANDARD_GRAVITY

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class DeviceSample(NamedTuple):
    """One instant, in the *device's* axes (z out of the chip's face; the world of ``q`` has z up, yaw arbitrary).

    ``age_us`` is how long before the last byte it was measured, where the format says so; a new ``epoch`` means
    that the device started again, so that its counter has nothing to do with the one before.
    """

    ticks: int | None
    acc: Vec3
    """Specific force, m/s^2."""
    gyro: Vec3 | None = None
    """rad/s."""
    q: Quat | None = None
    """Device to world, ``[x, y, z, w]``, unit."""
    accuracy: int | None = None
    """0 (unreliable) to 3."""
    age_us: int = 0
    epoch: int = 0


class DeviceClock(NamedTuple):
    """The counter behind ``DeviceSample.ticks``: it runs from 0 to ``modulus`` - 1 and starts again."""

    modulus: int
    tick_us: float
    tolerance: float
    """How far the rate of its ticks may be off, relative."""


class Decoder(ABC):
    """Bytes to samples, incrementally: any split of the bytes gives the same samples and the same counts.

    Sans-I/O: it reads no clock and no port, and never raises for what arrives.
    """

    clock: DeviceClock | None = None
    """None where the device counts nothing that is as regular as its samples."""

    def __init__(self) -> None:
        self.drops: Counter[str] = Counter()
        """What was dropped, by reason."""

    @abstractmethod
    def feed(self, data: bytes) -> list[DeviceSample]:
        """The samples that are complete with these bytes."""

    def to_send(self, now_s: float) -> list[bytes]:
        """Frames that the device is due at ``now_s`` (any monotonic clock); most devices want none."""
        return []


def gravity_in_device(q: Quat) -> Vec3:
    """Specific force of rest, m/s^2, in the axes of a device whose rotation to a z-up world is ``q``.

    The third row of the rotation matrix: what ``rotations.unrotate(q, (0, 0, g))`` gives, 30 times faster.
    """
    x, y, z, w = q
    g = STANDARD_GRAVITY
    return 2.0 * g * (x * z - w * y), 2.0 * g * (y * z + w * x), g * (1.0 - 2.0 * (x * x + y * y))


def with_gravity(linear: Vec3, q: Quat) -> Vec3:
    """Specific force of a device that reports linear acceleration, m/s^2."""
    down = gravity_in_device(q)
    return linear[0] + down[0], linear[1] + down[1], linear[2] + down[2]


def unit_quaternion(x: float, y: float, z: float, w: float, slack: float) -> Quat | None:
    """``[x, y, z, w]`` normalised, or None where its length is off by more than ``slack`` (relative), or not finite."""
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) <= slack:
        return None
    return x / norm, y / norm, z / norm, w / norm
