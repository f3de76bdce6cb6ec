"""What can go wrong with sensors, as values. Times are s from the scenario's start; a window is [start, end)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.rotations import Array
from foottrack_service.simulation.truth import Flags

Source = Literal["imu-left", "imu-right", "camera", "headset"]


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault that holds from `start` to `end`."""

    start: float = 0.0
    end: float = math.inf

    def covers(self, t: Array) -> Flags:
        """At which of the times (n,), s, it holds."""
        flags: Flags = (t >= self.start) & (t < self.end)
        return flags


@dataclass(frozen=True, kw_only=True)
class ImuDropout(Fault):
    """The IMU is silent."""

    side: Side


@dataclass(frozen=True, kw_only=True)
class PacketLoss(Fault):
    """A share of the IMU's packets is lost on the air."""

    side: Side
    share: float = 0.5


@dataclass(frozen=True, kw_only=True)
class RepeatedStamps(Fault):
    """A share of the samples carries the stamp of the one before: dt = 0."""

    side: Side
    share: float = 0.3


@dataclass(frozen=True, kw_only=True)
class ReversedStamps(Fault):
    """A share of the samples has its stamp swapped with the next one's."""

    side: Side
    share: float = 0.3


@dataclass(frozen=True, kw_only=True)
class ClockJump(Fault):
    """A producer's stamps are off by `offset` s."""

    source: Source
    offset: float = 0.25


@dataclass(frozen=True, kw_only=True)
class Saturation(Fault):
    """The accelerometer clips at `limit` m/s^2 per axis, far below its range."""

    side: Side
    limit: float = 12.0


@dataclass(frozen=True, kw_only=True)
class NotANumber(Fault):
    """A share of the IMU's samples holds a NaN. The codec refuses them; a recording played offline may not."""

    side: Side
    share: float = 0.2


@dataclass(frozen=True, kw_only=True)
class CameraBlackout(Fault):
    """No pictures: marker and depth are silent."""


@dataclass(frozen=True, kw_only=True)
class FalseTags(Fault):
    """A thing on the floor is taken for one shoe's tag, in a share of the pictures, always at the same spot.

    `lies`: it is a tag, which lies flat and always looks the same; else its attitude is another in each picture.
    """

    side: Side
    share: float = 0.8
    lies: bool = False


@dataclass(frozen=True, kw_only=True)
class SwappedSides(Fault):
    """The camera takes the left foot for the right one and the right for the left."""


@dataclass(frozen=True, kw_only=True)
class WrongIdentity(Fault):
    """The camera takes the *other* shoe's tag for this one's, too."""

    side: Side


@dataclass(frozen=True, kw_only=True)
class HeadsetLost(Fault):
    """The headset is not tracked, and says so."""


@dataclass(frozen=True, kw_only=True)
class HeadsetRecentred(Fault):
    """The stage is turned by `yaw` rad about its origin and then moved by `shift` (x, z) m, from `start` on.

    With `known` the source says by how much (`moved`), else only that `origin` has changed.
    """

    yaw: float = math.radians(25.0)
    shift: tuple[float, float] = (0.4, -0.3)
    known: bool = True


@dataclass(frozen=True, kw_only=True)
class MountSlipped(Fault):
    """The camera sits elsewhere on the headset than configured: turned by `turn` (rotation vector, rad, camera frame)
    and moved by `shift` (m, head frame)."""

    turn: tuple[float, float, float] = (math.radians(1.0), 0.0, 0.0)
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)


def chosen(fault: Fault, t: Array, share: float, random: np.random.Generator) -> Flags:
    """A random share of the times (n,) that the fault covers. Draws for all, so that windows do not shift draws."""
    flags: Flags = fault.covers(t) & (random.random(len(t)) < share)
    return flags
