"""Where bodies go besides the bus. All of it is off by default, and goes to this host unless told otherwise."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from foottrack_service.section import Section

Hertz = Annotated[float, Field(gt=0.0, le=1000.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Port = Annotated[int, Field(ge=1, le=65535)]


class TargetSettings(Section):
    """What all have."""

    enabled: bool = False
    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    max_hz: Hertz = 60.0


class VmcSettings(TargetSettings):
    """A VMC marionette: an application that draws an avatar."""

    port: Port = 39539
    legs_only: bool = Field(
        default=False, description="legs without root and hips: the rest of the body comes from another performer"
    )


class VrchatSettings(TargetSettings):
    """VRChat's OSC trackers. On a headset without PC, ``host`` is the headset's address."""

    port: Port = 9000
    knees: bool = Field(default=False, description="VRChat's own advice: fewer trackers, better legs")
    head: bool = Field(default=True, description="also the head, to which VRChat aligns its tracking space")
    head_joint: tuple[Finite, Finite, Finite] = Field(
        default=(0.0, -0.1, 0.085),
        description="from between the eyes to where an avatar's head bone begins, head frame, m: VRChat aligns to that",
    )


class VmtSettings(TargetSettings):
    """Virtual Motion Tracker: trackers in SteamVR."""

    port: Port = 39570
    max_hz: Hertz = 100.0
    knees: bool = True
    first_index: Annotated[int, Field(ge=0, le=53)] = Field(
        default=0, description="of five of VMT's 58 trackers: waist, left foot, right foot, left knee, right knee"
    )


class BridgesSettings(Section):
    """All of them."""

    vmc: VmcSettings = VmcSettings()
    vrchat: VrchatSettings = VrchatSettings()
    vmt: VmtSettings = VmtSettings()

    @property
    def idle(self) -> bool:
        """Whether none is asked for."""
        return not self.enabled

    @property
    def enabled(self) -> dict[str, VmcSettings | VrchatSettings | VmtSettings]:
        """Those that are asked for, by name."""
        every: dict[str, VmcSettings | VrchatSettings | VmtSettings]
        every = {"vmc": self.vmc, "vrchat": self.vrchat, "vmt": self.vmt}
        return {name: target for name, target in every.items() if target.enabled}
