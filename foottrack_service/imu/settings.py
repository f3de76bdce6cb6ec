"""Settings of the IMUs, ``[imu]`` in ``foottrack.toml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from foottrack_service.imu.axes import FLAT_ON_THE_FOOT, Axes
from foottrack_service.imu.formats.slimevr import DEFAULT_PORT
from foottrack_service.section import Section

Format = Literal["off", "ascii", "rvc", "bno08x", "raw", "slimevr"]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


def _axes(text: str) -> str:
    Axes(text)
    return text


class ImuDeviceSettings(Section):
    """The IMU on one foot."""

    format: Format = Field(default="off", description="what it speaks; off: somebody else publishes it, or nobody")
    port: str = Field(
        default="auto",
        description="COM3 or /dev/ttyUSB0; VID:PID or VID:PID:SERIAL of its USB adapter; auto; of a SlimeVR tracker "
        "its MAC address, with /1 for its second sensor, or auto",
    )
    baud: Annotated[int, Field(gt=0)] | None = Field(default=None, description="nil: the format's own")
    axes: Annotated[str, AfterValidator(_axes)] = Field(
        default=FLAT_ON_THE_FOOT,
        description="which of the chip's axes are right, up and back on the wire: lying flat, its y to the toes",
    )
    delay: Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)] = Field(
        default=0.0, description="known delay of device and line, s: taken off its stamps"
    )
    rate: Positive = Field(default=400.0, le=1000.0, description="what is asked of a bno08x, Hz")
    separator: Annotated[str, Field(min_length=1, max_length=1, pattern=r"[^0-9eE.+\-;LR]")] = Field(
        default=",", description="between the fields of ascii"
    )
    tick: Positive = Field(default=1e-6, description="unit of the time in ascii, s")
    yaw_clockwise: bool = Field(default=True, description="how rvc counts yaw, seen from above")
    acc_turn: Annotated[float, Field(allow_inf_nan=False)] | None = Field(
        default=None,
        description="turn of a slimevr tracker's accelerations about its z, rad; nil: what its protocol says",
    )


class ImuSettings(Section):
    """Both feet's IMUs."""

    left: ImuDeviceSettings = ImuDeviceSettings()
    right: ImuDeviceSettings = ImuDeviceSettings()
    slimevr_host: str = Field(default="0.0.0.0", description="where SlimeVR trackers are awaited")
    slimevr_port: Annotated[int, Field(ge=0, le=65535)] = DEFAULT_PORT

    @property
    def idle(self) -> bool:
        """Whether the node has nothing to do."""
        return self.left.format == self.right.format == "off"
