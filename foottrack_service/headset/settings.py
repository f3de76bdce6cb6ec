"""Settings of the headset, ``[headset]`` in ``foottrack.toml``."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from foottrack_protocol.messages import Quat, Vec3
from foottrack_service.section import Section

Seconds = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]


class RigidSettings(Section):
    """A part's place [m] and rotation (part to parent) on its parent."""

    p: Vec3 = (0.0, 0.0, 0.0)
    q: Quat = (0.0, 0.0, 0.0, 1.0)


class VmcSettings(Section):
    """Virtual Motion Capture's protocol: OSC over UDP, Unity's axes."""

    host: str = Field(default="127.0.0.1", description="where it is listened; 0.0.0.0 takes it from other machines too")
    port: Annotated[int, Field(ge=0, le=65535)] = 39539
    take: Literal["auto", "hmd", "bone"] = Field(
        default="auto", description="the headset's own pose, or the avatar's head bone; auto: the better one that comes"
    )
    eyes: RigidSettings = Field(
        default=RigidSettings(), description="the head frame (between the eyes) on the avatar's head bone"
    )
    latency: Seconds = Field(
        default=0.0,
        description="least time from when a pose was true to its datagram's arrival: taken off its stamp, s",
    )


class OpenVrSettings(Section):
    """SteamVR's runtime. Truth is for evaluation: a tracker strapped to the foot."""

    truth_left: str = Field(default="", description="serial of the tracker or controller on the left foot: truth/left")
    truth_right: str = Field(default="", description="likewise")
    ankle_left: RigidSettings = Field(default=RigidSettings(), description="the foot's frame in that tracker's")
    ankle_right: RigidSettings = Field(default=RigidSettings(), description="likewise")


class OpenXrSettings(Section):
    """An OpenXR runtime that allows sessions without pictures (XR_MND_headless)."""

    inferred: bool = Field(
        default=False, description="take positions that the runtime only infers, not tracks, as tracked"
    )


class HeadsetSettings(Section):
    """Where the head's pose comes from."""

    @model_validator(mode="before")
    @classmethod
    def _camera_is_elsewhere(cls, values: Any) -> Any:
        if isinstance(values, dict) and "camera" in values:
            raise ValueError("where the camera sits on the headset is [camera] mount = { p = [...], q = [...] }")
        return values

    source: Literal["bus", "vmc", "openvr", "openxr"] = Field(
        default="bus", description="bus: an engine publishes head/pose, or nobody does"
    )
    rate: Annotated[float, Field(ge=10.0, le=1000.0)] = Field(
        default=90.0, description="how often openvr and openxr are asked, Hz"
    )
    vmc: VmcSettings = VmcSettings()
    openvr: OpenVrSettings = OpenVrSettings()
    openxr: OpenXrSettings = OpenXrSettings()

    @property
    def needs_openvr(self) -> bool:
        """For the head or for truth."""
        return self.source == "openvr" or bool(self.openvr.truth_left or self.openvr.truth_right)

    @property
    def idle(self) -> bool:
        """Whether the node has nothing to do."""
        return self.source == "bus" and not self.needs_openvr
