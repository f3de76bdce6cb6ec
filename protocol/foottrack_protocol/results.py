"""Bodies that fusion publishes: the lower body, targets for an avatar, the gait. What is not known is nil."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from foottrack_protocol.values import (
    Body,
    Bool,
    Coordinate,
    Count,
    Direction,
    Hertz,
    Length,
    NotPositive,
    Phase,
    Pose,
    Position,
    Quat,
    Seconds,
    Side,
    Speed,
    Stage,
    Velocity,
)

_PAIR_EVENTS = ("first_step", "stop")
_SIDE_UNLESS_PAIR: dict[str, Any] = {
    "if": {"properties": {"event": {"enum": list(_PAIR_EVENTS)}}},
    "else": {"required": ["side"], "properties": {"side": {"not": {"type": "null"}}}},
}


class FootPose(Body):
    """One leg at the message's instant, stage frame."""

    hip: Position | None = Field(default=None, description="hip joint")
    knee: Position | None = Field(default=None, description="knee joint")
    ankle: Pose = Field(description="ankle joint, foot to stage")
    toe: Position = Field(description="the toes' tip")
    v: Velocity = Field(description="the ankle's")
    contact: Bool = Field(description="some part of the foot stands, heel or toes")
    stage: Stage = Field(description="what the estimate rests on")
    sigma: Length = Field(description="radius of the ball round the ankle that should hold the truth in 68 % of cases")
    age: Seconds | None = Field(
        default=None, description="since the last optical measurement that was accepted; nil when there was none"
    )


class BodyPose(Body):
    """One coherent instant of the lower body, stage frame."""

    head: Pose | None = Field(default=None, description="the head pose that was used; nil without a headset")
    hips: Pose | None = Field(default=None, description="the hips' centre; nil without a headset")
    left: FootPose | None = Field(default=None, description="nil when nothing is known of the foot")
    right: FootPose | None = Field(default=None, description="nil when nothing is known of the foot")


class IkFoot(Body):
    """IK target of one foot and its knee's hint, avatar frame."""

    p: Position = Field(description="ankle")
    q: Quat = Field(description="foot to avatar")
    hint: Position = Field(description="where the knee should point")


class IkTargets(Body):
    """Targets for an avatar that walks where the user walks in place."""

    mode: Literal["stand", "walk"]
    left: IkFoot
    right: IkFoot
    pelvis_dy: NotPositive = Field(description="to add to the hips' standing height", json_schema_extra={"unit": "m"})
    speed: Speed = Field(description="the avatar's, forward")
    heading: Direction = Field(description="where forward is, stage")


class FootGait(Body):
    """Gait of one foot."""

    phase: Phase
    height: Coordinate = Field(description="ankle above its standing height")
    vy: Speed = Field(description="the ankle's, upwards")


class GaitState(Body):
    """Gait of the pair."""

    left: FootGait | None = None
    right: FootGait | None = None
    cadence: Hertz = Field(description="steps per second")
    speed: Speed = Field(description="of locomotion, forward")
    steps: Count = Field(description="since the start")


class GaitEvent(Body):
    """Something that happened at the envelope's `t`. A foot's own event has a side; those of the pair may not."""

    model_config = ConfigDict(json_schema_extra=_SIDE_UNLESS_PAIR)

    side: Side | None = None
    event: Literal["heel_off", "toe_off", "mid_swing", "terminal_swing", "foot_strike", "first_step", "stop"]
    step: Count = Field(description="number of the step that it belongs to")

    @model_validator(mode="after")
    def _foot_has_side(self) -> Self:
        if self.side is None and self.event not in _PAIR_EVENTS:
            raise ValueError(f"{self.event} needs a side")
        return self
