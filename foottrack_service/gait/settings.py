"""Settings of the gait."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from foottrack_service.section import Section


class GaitSettings(Section):
    """How an avatar walks where its user walks in place."""

    mode: Literal["ours", "reference", "keyframe"] = Field(
        default="ours",
        description="how the avatar's legs move: ours, the published equations, or a clip that is not synchronised",
    )
    speed: Literal["gud-wip", "llcm", "amplitude"] = Field(
        default="gud-wip", description="from steps to metres per second: by cadence, by the feet's speed, by both"
    )
    most_speed: float = Field(default=3.5, gt=0.0, le=20.0, description="m/s")
    lerp: bool = Field(default=True, description="reference: smooth its targets; false shows its equations bare")
    headset_alone: bool = Field(
        default=True, description="where no foot is known, take steps from how the head bobs up and down"
    )
