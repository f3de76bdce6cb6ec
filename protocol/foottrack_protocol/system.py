"""Bodies of the service's own streams: who serves, how it is, what it has to say."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from foottrack_protocol.values import MAX_ITEMS, Body, Count, Counts, Hertz, Nanoseconds, NotNegative, Seconds, Str

USER_PATTERN = r"^[a-z0-9][a-z0-9-]{0,31}$"
"""Of a user's name; `sys` is reserved beside it."""
Milliseconds = Annotated[NotNegative, Field(json_schema_extra={"unit": "ms"})]


class ProtocolVersion(Body):
    """Version of the wire."""

    major: Count
    minor: Count


class ClockAnchor(Body):
    """The same instant on the bus clock and in Unix time."""

    bus: Nanoseconds
    unix: Nanoseconds


class Session(Body):
    """Who serves this bus."""

    session: Str = Field(description="random id of this run of the service")
    protocol: ProtocolVersion
    clock: ClockAnchor
    users: Annotated[list[Annotated[Str, StringConstraints(pattern=USER_PATTERN)]], Field(max_length=MAX_ITEMS)]
    config_hash: Str = Field(description="names the settings: equal when nothing that results depend on differs")


class TopicHealth(Body):
    """How one topic has been in the last second (`hz`) and since the start (the rest)."""

    hz: Hertz = Field(description="messages per second")
    messages: Count
    gaps: Count = Field(description="messages missed, by `seq`")
    drops: Counts = Field(default={}, description="refused messages by reason")
    age: Seconds | None = Field(default=None, description="since the last arrival")


class FilterHealth(Body):
    """What one filter did with its measurements since the start."""

    accepted: Counts = Field(default={}, description="by kind: imu, marker, depth")
    rejected: Counts = Field(default={}, description="by reason")


class NodeHealth(Body):
    """One node of the service."""

    state: Literal["starting", "running", "restarting", "failed", "stopped"]
    restarts: Count = 0
    error: Str | None = None


class Latency(Body):
    """Arrival of an IMU sample to the hand-over of the pose that it brought on, in the last second."""

    p50: Milliseconds
    p99: Milliseconds


class Health(Body):
    """How the service is."""

    topics: Annotated[dict[Str, TopicHealth], Field(max_length=MAX_ITEMS)] = Field(default={}, description="by topic")
    filters: Annotated[dict[Str, FilterHealth], Field(max_length=MAX_ITEMS)] = Field(
        default={},
        description="by `user/side`; of the camera's mount (found, slipped), by `user/mount`; of what a device gave, "
        "by `user/device`",
    )
    nodes: Annotated[dict[Str, NodeHealth], Field(max_length=MAX_ITEMS)] = Field(default={}, description="by name")
    drops: Counts = Field(
        default={},
        description="refused messages that name no topic, by reason; what else names none, as `who/reason`",
    )
    latency_ms: Latency | None = None


class LogRecord(Body):
    """A log record of warning or above."""

    level: Literal["warning", "error", "critical"]
    logger: Str
    message: Str
