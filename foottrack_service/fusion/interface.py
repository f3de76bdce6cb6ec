"""What goes into a foot's filter and what comes out: the values that every filter shares.

A filter is pure: it reads no clock, and every instant is an argument in ns of the bus clock. Vectors are arrays of
shape (3,), quaternions ``[x, y, z, w]`` of shape (4,), in the wire's frames and units (see foottrack_protocol.frames).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, NamedTuple, Protocol

from foottrack_service.config import Placement
from foottrack_service.rotations import Array

Kind = Literal["marker", "depth"]
Stage = Literal["marker", "depth", "inertial", "coasting", "lost"]

FIX_MEMORY_S = 0.1
"""A foot is in stage "marker" or "depth" while such a fix was accepted so recently; likewise its IMU lives."""
COASTING_S = 0.5
"""How long a foot may coast on nothing before it is lost."""
LOST_SIGMA_M = 0.3
"""A foot that is less sure than this is lost."""


class Verdict(StrEnum):
    """What became of an optical fix. All but ACCEPTED are counted as rejected under this name."""

    ACCEPTED = "accepted"
    STALE = "stale"
    NO_HEAD_POSE = "no_head_pose"
    SIZE = "size"
    BORDER = "border"
    GATE = "gate"
    UNCONFIRMED = "unconfirmed"
    UNUSED = "unused"
    INVALID = "invalid"
    IDENTITY = "identity"
    """It shows the other foot."""


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One sample, sensor frame. At least one of ``gyro`` and ``q`` is there."""

    t: int
    acc: Array
    """Specific force, m/s^2."""
    gyro: Array | None
    """rad/s."""
    q: Array | None
    """Sensor to the device's own gravity-aligned frame, yaw arbitrary."""


@dataclass(frozen=True, slots=True)
class HeadSample:
    """The head in the stage at one instant."""

    t: int
    p: Array
    q: Array


@dataclass(frozen=True, slots=True)
class OpticalFix:
    """Where a camera saw the foot's target, and where the head was."""

    t: int
    """Mid-exposure of the target's rows."""
    kind: Kind
    p: Array
    """The target's centre in the head frame, m."""
    q: Array | None
    """Target to head."""
    q_alt: Array | None
    """The planar pose's other solution."""
    cov: Array
    """Shape (3, 3), m^2, head frame."""
    size_ratio: float | None
    edge_px: float
    head: HeadSample
    """Interpolated at ``t``."""
    head_at_arrival: HeadSample
    """The newest there was when the fix arrived: what the reference filter uses."""
    strange: bool = False
    """The picture's or the head's age is not what it usually is, as if a clock had jumped."""


@dataclass(frozen=True, slots=True)
class FootEstimate:
    """A foot at one instant, in the stage."""

    t: int
    p: Array
    """Ankle, m."""
    q: Array
    """Foot to stage."""
    v: Array
    """Ankle velocity, m/s."""
    contact: bool
    stage: Stage
    sigma: float
    """Radius of the ball that should hold the ankle in 68 % of cases, m."""
    age: float | None
    """Since the last accepted optical fix, s."""


class Target(NamedTuple):
    """Where a foot's fixes are expected."""

    p: Array
    """m, stage."""
    sigma: float
    """m per axis."""
    seen: bool
    """Whether such a fix was accepted there lately."""


Whereabouts = Callable[[Kind, int], Target | None]
"""A foot's ``FootFilter.target``."""

Moves = Callable[[int, int], bool | None]
"""A foot's ``FootFilter.moves``."""


class FootFilter(Protocol):
    """One foot's filter."""

    waits_for_head: bool
    """Whether a fix is held back until the head pose at its own instant is known."""

    @property
    def standing(self) -> bool:
        """Whether the foot stood still when the newest measurement was made."""

    def on_imu(self, sample: ImuSample) -> bool:
        """Take a sample, in order of arrival. False: it is left out, from the past mostly."""

    def on_fix(self, fix: OpticalFix, now: int) -> Verdict:
        """Take an optical fix that arrives at ``now``, later than its own ``t``."""

    def on_floor(self, height: float) -> None:
        """The floor is at this height in the stage, m."""

    def on_imu_yaw(self, yaw: float) -> None:
        """The yaw of the device's own frame in the stage was calibrated, rad."""

    def on_imu_placement(self, placement: Placement) -> None:
        """The sensor's place on the shoe was calibrated."""

    def on_recentred(self, p: Array | None, q: Array | None) -> None:
        """The stage moved by the rigid motion old to new, or by an unknown one (None: re-acquire)."""

    def on_head_lost(self) -> None:
        """The headset does not know where it is: when it does again, the stage may lie elsewhere."""

    def beside(self, other: Whereabouts, moves: Moves) -> None:
        """There is another foot, and what it knows of itself tells whose a fix is."""

    def moves(self, frm: int, to: int) -> bool | None:
        """Whether the IMU shows the foot swinging, or standing, between two instants, ns; None: neither."""

    def target(self, kind: Kind, t: int) -> Target | None:
        """Where fixes of ``kind`` are expected at ``t``, ns; None while that is not well known."""

    def estimate(self, t: int) -> FootEstimate | None:
        """The foot predicted to ``t``; None before anything is known."""
