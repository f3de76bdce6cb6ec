"""Bodies of the messages (the envelope's ``data``), one model a stream.

Validation is the gate that no bad number passes: floats are finite, an integer where a float is due is a float,
nothing else is coerced; quaternions are unit within 1e-3 and normalised on receipt; unknown keys are ignored.
A key that may be nil may also be absent.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    StringConstraints,
    model_validator,
)
from pydantic.types import Strict

UNIT_TOLERANCE = 1e-3
"""How far a quaternion's length may be off 1."""


def _unit(q: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    # Normalising what is already normal would change last bits and make re-encoding differ.
    if abs(squared - 1.0) <= 2e-15:
        return q
    norm = math.sqrt(squared)
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise ValueError(f"quaternion of length {norm:.6g}, must be 1 within {UNIT_TOLERANCE}")
    return (q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm)


def _semidefinite(cov: tuple[float, ...]) -> tuple[float, ...]:
    xx, xy, xz, yy, yz, zz = cov
    slack = 1e-9 * max(abs(c) for c in cov)
    minors = (
        xx,
        yy,
        zz,
        xx * yy - xy * xy + slack * (xx + yy),
        xx * zz - xz * xz + slack * (xx + zz),
        yy * zz - yz * yz + slack * (yy + zz),
    )
    det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    if min(minors) < 0.0 or det < -slack * max(xx, yy, zz) ** 2:
        raise ValueError("covariance is not positive semidefinite")
    return cov


Float = Annotated[float, Strict(), Field(allow_inf_nan=False)]
NotNegative = Annotated[float, Strict(), Field(allow_inf_nan=False, ge=0.0)]
Int = Annotated[int, Strict()]
Bool = Annotated[bool, Strict()]
Str = Annotated[str, Strict()]
Nanoseconds = Annotated[int, Strict(), Field(ge=-(2**63), lt=2**63)]
Vec3 = tuple[Float, Float, Float]
Quat = Annotated[tuple[Float, Float, Float, Float], AfterValidator(_unit)]
Cov3 = Annotated[tuple[Float, Float, Float, Float, Float, Float], AfterValidator(_semidefinite)]
Side = Literal["left", "right"]
Stage = Literal["marker", "depth", "inertial", "coasting", "lost"]
Phase = Literal["stance", "ascending", "mid_swing", "descending", "terminal_swing"]


class Body(BaseModel):
    """Base of all bodies: unknown keys are ignored, so that minor versions may add some."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Pose(Body):
    """Position [m] and rotation, body to parent."""

    p: Vec3
    q: Quat


# ---------------------------------------------------------------- measurements


class Imu(Body):
    """One sample of an IMU on a foot. ``t`` of the envelope is the sampling instant."""

    acc: Vec3 = Field(description="specific force (9.81 upwards at rest), sensor frame, m/s^2")
    gyro: Vec3 | None = Field(default=None, description="angular rate, sensor frame, rad/s")
    q: Quat | None = Field(
        default=None,
        description="sensor to a gravity-aligned frame (+Y up, yaw arbitrary and slowly drifting)",
    )
    t_dev: Int | None = Field(default=None, description="the device's own counter, us")
    t_arr: Nanoseconds = Field(description="arrival on the host, bus clock, ns")
    accuracy: Annotated[int, Strict(), Field(ge=0, le=3)] | None = Field(
        default=None, description="the device's own word on its calibration, 0 (unreliable) to 3 (high)"
    )

    @model_validator(mode="after")
    def _turns_somehow(self) -> Self:
        if self.gyro is None and self.q is None:
            raise ValueError("at least one of gyro and q is needed")
        return self


class Optical(Body):
    """Where a foot's optical target was seen. ``t`` is the mid-exposure of the target's own rows.

    The camera publishes what it found; whether to believe it is fusion's matter.
    """

    p: Vec3 = Field(description="the target's centre, head frame, m")
    q: Quat | None = Field(default=None, description="target to head")
    q_alt: Quat | None = Field(
        default=None, description="the other solution of the planar pose; gravity decides between q and q_alt"
    )
    cov: Cov3 = Field(description="xx, xy, xz, yy, yz, zz, m^2, head frame: the picture's and the depth's own noise")
    size_ratio: NotNegative | None = Field(default=None, description="range by depth / range by apparent size")
    reproj_px: NotNegative | None = Field(default=None, description="rms reprojection error, px")
    edge_px: Float = Field(description="least distance of a corner to the picture's border, px")
    frame: Int = Field(description="number of the picture, rising")


class HeadPose(Body):
    """The headset. Nil ``p`` and ``q`` when it is not tracked."""

    p: Vec3 | None = Field(default=None, description="head in the stage, m")
    q: Quat | None = Field(default=None, description="head to stage")
    tracked: Bool
    origin: Int = Field(default=0, description="changes when the stage was recentred or jumped")
    moved: Pose | None = Field(default=None, description="old stage to new, when the source knows it")

    @model_validator(mode="before")
    @classmethod
    def _nil_origin_is_zero(cls, data: object) -> object:
        if isinstance(data, dict) and "origin" in data and data["origin"] is None:
            return {**data, "origin": 0}
        return data

    @model_validator(mode="after")
    def _tracked_has_pose(self) -> Self:
        if self.tracked and (self.p is None or self.q is None):
            raise ValueError("a tracked head needs p and q")
        return self


class Truth(Pose):
    """The ankle in the stage, from a reference system. Recorded and compared, never fused."""


class FloorValues(Body):
    """What the floor calibration found."""

    height: Float = Field(description="floor above the stage's y = 0, m")


class PerSideYaw(Body):
    """Yaw of each device's own frame against the stage, rad."""

    left: Float | None = None
    right: Float | None = None


class HeadingValues(Body):
    """What the heading calibration found."""

    yaw: Float = Field(description="the user's forward against the stage's -Z, positive to the left, rad")
    imu_yaw: PerSideYaw = Field(default=PerSideYaw(), description="yaw of each IMU's own frame in the stage, rad")


class BodyValues(Body):
    """The user's measures, m."""

    height: NotNegative
    thigh: NotNegative
    shank: NotNegative
    torso: NotNegative
    hip_width: NotNegative
    hip_back: Float


class MountValues(Body):
    """Correction of the camera's mount on the headset, applied by fusion on top of the configured one."""

    p: Vec3 = Field(description="m, head frame")
    q: Quat
    sigma_p: NotNegative = Field(description="m, per axis")
    sigma_q: NotNegative = Field(description="rad, per axis")
    base: Str = Field(description="hash of the configured mount that this corrects")


class ImuValues(Body):
    """What is known of one foot's IMU."""

    side: Side
    acc_bias: Vec3 = Field(description="sensor frame, m/s^2")
    gyro_bias: Vec3 = Field(description="sensor frame, rad/s")
    p: Vec3 = Field(description="sensor in the foot's frame, m")
    q: Quat = Field(description="sensor to foot")


class FloorCalibration(Body):
    """Floor height."""

    kind: Literal["floor"] = "floor"
    values: FloorValues


class HeadingCalibration(Body):
    """Forward, and the yaw of the IMUs."""

    kind: Literal["heading"] = "heading"
    values: HeadingValues


class BodyCalibration(Body):
    """The user's measures."""

    kind: Literal["body"] = "body"
    values: BodyValues


class MountCalibration(Body):
    """The camera's mount."""

    kind: Literal["mount"] = "mount"
    values: MountValues


class ImuCalibration(Body):
    """One IMU."""

    kind: Literal["imu"] = "imu"
    values: ImuValues


Calibration = Annotated[
    FloorCalibration | HeadingCalibration | BodyCalibration | MountCalibration | ImuCalibration,
    Discriminator("kind"),
]


class CameraPreview(Body):
    """A picture with what was found drawn in."""

    jpeg: Annotated[bytes, Strict()]


# ---------------------------------------------------------------- results


class FootPose(Body):
    """One leg at the message's instant, stage frame."""

    hip: Vec3 | None = None
    knee: Vec3 | None = None
    ankle: Pose
    toe: Vec3
    v: Vec3 = Field(description="ankle velocity, m/s")
    contact: Bool = Field(description="some part of the foot stands, heel or toes")
    stage: Stage
    sigma: NotNegative = Field(description="radius of the ball that should hold the ankle in 68 % of cases, m")
    age: NotNegative | None = Field(default=None, description="since the last accepted optical measurement, s")


class BodyPose(Body):
    """One coherent instant of the lower body. What is not known is nil."""

    head: Pose | None = None
    hips: Pose | None = None
    left: FootPose | None = None
    right: FootPose | None = None


class IkFoot(Body):
    """IK target of one foot and its knee's hint, avatar frame."""

    p: Vec3
    q: Quat
    hint: Vec3


class IkTargets(Body):
    """Targets for an avatar that walks where the user walks in place."""

    mode: Literal["stand", "walk"]
    left: IkFoot
    right: IkFoot
    pelvis_dy: Annotated[float, Strict(), Field(allow_inf_nan=False, le=0.0)] = Field(
        description="to add to the hips' standing height, m"
    )
    speed: Float = Field(description="forward, m/s")
    heading: Vec3 = Field(description="unit, stage: where forward is")


class FootGait(Body):
    """Gait of one foot."""

    phase: Phase
    height: Float = Field(description="ankle above its standing height, m")
    vy: Float = Field(description="m/s")


class GaitState(Body):
    """Gait of the pair."""

    left: FootGait | None = None
    right: FootGait | None = None
    cadence: NotNegative = Field(description="steps/s")
    speed: Float = Field(description="m/s")
    steps: Annotated[int, Strict(), Field(ge=0)]


class GaitEvent(Body):
    """Something that happened at the envelope's ``t``. The pair's own events have no side."""

    side: Side | None = None
    event: Literal["heel_off", "toe_off", "mid_swing", "terminal_swing", "foot_strike", "first_step", "stop"]
    step: Annotated[int, Strict(), Field(ge=0)]


# ---------------------------------------------------------------- the system's own


class ProtocolVersion(Body):
    """Version of the wire."""

    major: Int
    minor: Int


class ClockAnchor(Body):
    """The same instant on the bus clock and in Unix time, ns."""

    bus: Nanoseconds
    unix: Nanoseconds


class Session(Body):
    """Who serves this bus."""

    session: Str
    protocol: ProtocolVersion
    clock: ClockAnchor
    users: list[Annotated[str, Strict(), StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,31}$")]]
    config_hash: Str


class TopicHealth(Body):
    """How one topic has been in the last second (``hz``) and since the start (the rest)."""

    hz: NotNegative
    messages: Int
    gaps: Int = Field(description="messages missed, by seq")
    drops: dict[str, Int] = Field(default={}, description="refused messages by reason")
    age: NotNegative | None = Field(default=None, description="since the last arrival, s")


class FilterHealth(Body):
    """What one filter did with its measurements since the start."""

    accepted: dict[str, Int] = Field(default={}, description="by kind: imu, marker, depth")
    rejected: dict[str, Int] = Field(default={}, description="by reason")


class NodeHealth(Body):
    """One node of the service."""

    state: Literal["starting", "running", "restarting", "failed", "stopped"]
    restarts: Int = 0
    error: Str | None = None


class Latency(Body):
    """Arrival of an IMU sample to the hand-over of the pose that it brought on, ms, in the last second."""

    p50: NotNegative
    p99: NotNegative


class Health(Body):
    """How the service is."""

    topics: dict[str, TopicHealth] = Field(default={}, description="by topic")
    filters: dict[str, FilterHealth] = Field(default={}, description="by user/side")
    nodes: dict[str, NodeHealth] = Field(default={}, description="by name")
    drops: dict[str, Int] = Field(default={}, description="refused messages that name no topic, by reason")
    latency_ms: Latency | None = None


class LogRecord(Body):
    """A log record of warning or above."""

    level: Literal["warning", "error", "critical"]
    logger: Str
    message: Str
