"""The registry of streams: publishing, recording, health, the specification's table and the schemas derive from it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any, get_args, get_origin

from pydantic import TypeAdapter

from foottrack_protocol import messages as m
from foottrack_protocol.errors import TopicError
from foottrack_protocol.frames import SIDES
from foottrack_protocol.system import USER_PATTERN

DEFAULT_USER = "user"
SYSTEM = "sys"
WELCOME = b"sys/welcome"
"""What the egress socket says to a new subscriber: with ``sys/welcome/<token>`` the only message of one frame."""

RAW_PREFIX = "raw/"
"""How streams begin that are only published while somebody subscribes to them by name: to so much of it at least."""

_USER = re.compile(USER_PATTERN)


class Policy(StrEnum):
    """What a reader that cannot keep up should do."""

    LATEST = "latest"
    EVERY = "every"


class Role(StrEnum):
    """Where a stream stands in the flow."""

    MEASUREMENT = "measurement"
    REFERENCE = "reference"
    CALIBRATION = "calibration"
    RESULT = "result"
    PICTURE = "picture"
    RAW = "raw"
    SYSTEM = "system"


@dataclass(frozen=True, slots=True)
class Topic:
    """One stream: ``<user>/<stream>``, or ``sys/...`` for the system's own."""

    stream: str
    body: Any
    role: Role
    policy: Policy
    rate_hz: float | None
    """Nominal; None where it comes when something happens."""
    recorded: bool
    publisher: str
    schema: str
    """Name of the schema file, which streams with the same body share."""
    adapter: TypeAdapter[Any] = field(init=False, repr=False, compare=False)
    models: tuple[type, ...] = field(init=False, repr=False, compare=False)
    """The classes that a body of this stream may have."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "adapter", TypeAdapter(self.body))
        union = get_args(self.body)[0] if get_origin(self.body) is Annotated else self.body
        object.__setattr__(self, "models", get_args(union) or (union,))

    @property
    def is_system(self) -> bool:
        """Whether it belongs to the service and not to a user."""
        return self.role is Role.SYSTEM


def _both(kind: str, body: Any, role: Role, rate_hz: float, publisher: str, schema: str) -> list[Topic]:
    return [
        Topic(f"{kind}/{side}", body, role, Policy.EVERY, rate_hz, True, publisher.format(side=side), schema)
        for side in SIDES
    ]


_ALL = [
    *_both("imu", m.Imu, Role.MEASUREMENT, 400.0, "imu-{side}", "imu"),
    *_both("marker", m.Optical, Role.MEASUREMENT, 60.0, "camera", "optical"),
    *_both("depth", m.Optical, Role.MEASUREMENT, 60.0, "camera", "optical"),
    Topic("head/pose", m.HeadPose, Role.MEASUREMENT, Policy.EVERY, 90.0, True, "headset", "head_pose"),
    *_both("truth", m.Truth, Role.REFERENCE, 100.0, "reference system", "truth"),
    Topic("calibration", m.Calibration, Role.CALIBRATION, Policy.EVERY, 0.2, True, "calibration", "calibration"),
    Topic("camera/preview", m.CameraPreview, Role.PICTURE, Policy.LATEST, 5.0, False, "camera", "camera_preview"),
    *(
        Topic(f"raw/imu/{side}", m.RawImu, Role.RAW, Policy.EVERY, None, False, f"imu-{side}", "raw_imu")
        for side in SIDES
    ),
    Topic("raw/camera", m.RawPicture, Role.RAW, Policy.EVERY, None, False, "camera", "raw_picture"),
    Topic("pose/body", m.BodyPose, Role.RESULT, Policy.LATEST, 200.0, True, "fusion", "body_pose"),
    Topic("pose/ik", m.IkTargets, Role.RESULT, Policy.LATEST, 200.0, True, "fusion", "ik_targets"),
    Topic("gait/state", m.GaitState, Role.RESULT, Policy.LATEST, 200.0, True, "fusion", "gait_state"),
    Topic("gait/event", m.GaitEvent, Role.RESULT, Policy.EVERY, None, True, "fusion", "gait_event"),
    Topic("session", m.Session, Role.SYSTEM, Policy.EVERY, 1.0, True, "service", "session"),
    Topic("health", m.Health, Role.SYSTEM, Policy.EVERY, 1.0, True, "service", "health"),
    Topic("log", m.LogRecord, Role.SYSTEM, Policy.EVERY, None, True, "any node", "log_record"),
]

TOPICS: dict[str, Topic] = {topic.stream: topic for topic in _ALL if not topic.is_system}
"""Streams of a user, by name without the user."""

SYSTEM_TOPICS: dict[str, Topic] = {topic.stream: topic for topic in _ALL if topic.is_system}
"""Streams of the service, by name without ``sys/``."""


def is_user(name: str) -> bool:
    """Whether a name may stand for a user in a topic."""
    return name != SYSTEM and _USER.fullmatch(name) is not None


def lookup(user: str, stream: str) -> Topic:
    """The registry's entry. Raises TopicError when the user is malformed or the stream unknown."""
    if user == SYSTEM:
        found = SYSTEM_TOPICS.get(stream)
    elif _USER.fullmatch(user):
        found = TOPICS.get(stream)
    else:
        raise TopicError(f"{user!r} is no user name (a-z, 0-9 and '-', at most 32, '{SYSTEM}' is reserved)")
    if found is None:
        raise TopicError(f"no stream is called {stream!r}")
    return found


def topic_name(user: str, stream: str) -> str:
    """``<user>/<stream>``, checked. Raises TopicError."""
    lookup(user, stream)
    return f"{user}/{stream}"


def split_topic(topic: str) -> tuple[str, Topic]:
    """User (or ``sys``) and registry entry of a topic. Raises TopicError."""
    user, _, stream = topic.partition("/")
    return user, lookup(user, stream)
