"""Bodies that producers publish: measurements, the reference, calibrations, pictures."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, model_validator
from pydantic.types import Strict

from foottrack_protocol.values import (
    Acceleration,
    Angle,
    AngularRate,
    Bin,
    Body,
    Bool,
    Coordinate,
    Cov3,
    Float,
    Int,
    Length,
    Nanoseconds,
    NotNegative,
    Pose,
    Position,
    Quat,
    Side,
    Str,
)


def _given(key: str) -> dict[str, Any]:
    """JSON Schema of a map in which a key that may be nil is not."""
    return {"required": [key], "properties": {key: {"not": {"type": "null"}}}}


def _nil_is_zero(value: object) -> object:
    return 0 if value is None else value


class Imu(Body):
    """One sample of an IMU on a foot. At least one of `gyro` and `q` is there."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [_given("gyro"), _given("q")]})

    acc: Acceleration = Field(
        description="specific force (what an accelerometer measures: 9.81 upwards at rest), sensor frame"
    )
    gyro: AngularRate | None = Field(default=None, description="angular rate, sensor frame")
    q: Quat | None = Field(
        default=None, description="sensor to a gravity-aligned frame (+Y up, yaw arbitrary and slowly drifting)"
    )
    t_dev: Annotated[Int, Field(json_schema_extra={"unit": "us"})] | None = Field(
        default=None, description="the device's own counter"
    )
    t_arr: Nanoseconds = Field(description="arrival on the host, bus clock")
    accuracy: Annotated[int, Strict(), Field(ge=0, le=3)] | None = Field(
        default=None, description="the device's own word on its calibration: 0 unreliable, 3 high"
    )

    @model_validator(mode="after")
    def _turns_somehow(self) -> Self:
        if self.gyro is None and self.q is None:
            raise ValueError("at least one of gyro and q is needed")
        return self


class Optical(Body):
    """Where a foot's optical target (its tag, or the blob in the depth picture) was seen.

    A camera publishes what it found; whether to believe it is fusion's matter.
    """

    p: Position = Field(description="the target's centre, head frame")
    q: Quat | None = Field(default=None, description="target to head")
    q_alt: Quat | None = Field(
        default=None, description="the other solution of the planar pose (q may be the flipped one: gravity decides)"
    )
    cov: Cov3 = Field(
        description="xx, xy, xz, yy, yz, zz of p, head frame: the picture's and the depth's own noise only"
    )
    size_ratio: NotNegative | None = Field(
        default=None, description="range by depth / range by apparent size: 1 when they agree"
    )
    reproj_px: Annotated[NotNegative, Field(json_schema_extra={"unit": "px"})] | None = Field(
        default=None, description="rms reprojection error of the corners"
    )
    edge_px: Annotated[Float, Field(json_schema_extra={"unit": "px"})] = Field(
        description="least distance of a corner to the picture's border"
    )
    frame: Int = Field(description="number of the picture, rising")


class HeadPose(Body):
    """The headset. A head that is tracked has `p` and `q`."""

    model_config = ConfigDict(
        json_schema_extra={
            "if": {"properties": {"tracked": {"const": True}}, "required": ["tracked"]},
            "then": {"allOf": [_given("p"), _given("q")]},
        }
    )

    p: Position | None = Field(default=None, description="head in the stage; nil when not tracked")
    q: Quat | None = Field(default=None, description="head to stage; nil when not tracked")
    tracked: Bool
    origin: Annotated[Int, BeforeValidator(_nil_is_zero, json_schema_input_type=Int | None)] = Field(
        default=0, description="changes when the headset's stage was recentred or jumped; nil is 0"
    )
    moved: Pose | None = Field(
        default=None, description="old stage to new, in the first message of a new origin, when the source knows it"
    )

    @model_validator(mode="after")
    def _tracked_has_pose(self) -> Self:
        if self.tracked and (self.p is None or self.q is None):
            raise ValueError("a tracked head needs p and q")
        return self


class Truth(Pose):
    """The ankle in the stage, from a reference system. Recorded and compared, never fused."""


class FloorValues(Body):
    """What the floor calibration found."""

    height: Coordinate = Field(description="floor above the stage's y = 0")


class PerSideYaw(Body):
    """Yaw of each IMU's own gravity-aligned frame in the stage."""

    left: Angle | None = None
    right: Angle | None = None


class HeadingValues(Body):
    """What the heading calibration found."""

    yaw: Angle = Field(description="the user's forward against the stage's -Z, positive to the left")
    imu_yaw: PerSideYaw = Field(default=PerSideYaw(), description="per side")


class BodyValues(Body):
    """The user's measures."""

    height: Length = Field(description="standing")
    thigh: Length = Field(description="hip joint to knee joint")
    shank: Length = Field(description="knee joint to ankle joint")
    torso: Length = Field(description="head down to the hips' centre")
    hip_width: Length = Field(description="between the hip joints")
    hip_back: Coordinate = Field(description="hips' centre behind the head, along the head's yaw")
    neck_down: Length | None = Field(
        default=None, description="what the head nods about, below it; nil when not measured"
    )
    neck_back: Coordinate | None = Field(default=None, description="the same, behind it; nil when not measured")


class MountValues(Body):
    """Correction of the camera's mount on the headset, which fusion applies on top of the configured one."""

    p: Position = Field(description="head frame")
    q: Quat
    sigma_p: Length = Field(description="standard deviation per axis")
    sigma_q: Annotated[NotNegative, Field(json_schema_extra={"unit": "rad"})] = Field(
        description="standard deviation per axis"
    )
    base: Str = Field(description="hash of the configured mount that this corrects; no other mount takes it")


class ImuValues(Body):
    """What is known of one foot's IMU."""

    side: Side
    acc_bias: Acceleration = Field(description="sensor frame")
    gyro_bias: AngularRate = Field(description="sensor frame")
    p: Position = Field(description="sensor in the foot's frame")
    q: Quat = Field(description="sensor to foot")


class FloorCalibration(Body):
    """The floor's height."""

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
    """A picture with what was found drawn in. Off unless asked for."""

    jpeg: Bin
