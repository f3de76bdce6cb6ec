"""Requests on the control socket: what each takes, gives, and may be refused with.

A request is a msgpack map ``{cmd, args}``; its answer ``{ok: true, result}`` or
``{ok: false, error: {code, message}}``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any

from pydantic import Field, StringConstraints
from pydantic.types import Strict

from foottrack_protocol.measurements import BodyCalibration, FloorCalibration, HeadingCalibration, MountCalibration
from foottrack_protocol.system import USER_PATTERN, Health, Session
from foottrack_protocol.values import Body, Bool, Count, Nanoseconds, Seconds, Str


class Code(StrEnum):
    """Why a request was refused. Clients act on the code and show the message."""

    BAD_REQUEST = "bad_request"
    UNKNOWN_COMMAND = "unknown_command"
    BAD_ARGUMENTS = "bad_arguments"
    BUSY = "busy"
    UNAVAILABLE = "unavailable"
    NOT_RUNNING = "not_running"
    EXISTS = "exists"
    NOT_STILL = "not_still"
    FAILED = "failed"
    INTERNAL = "internal"


CODE_MEANINGS: dict[Code, str] = {
    Code.BAD_REQUEST: "not a msgpack map within the limits, or `cmd` is missing or no string, or `args` is no map",
    Code.UNKNOWN_COMMAND: "no such command, in this version or in this setup",
    Code.BAD_ARGUMENTS: "an argument is missing, unknown, of a wrong type, or out of its range",
    Code.BUSY: "the same kind of thing is already under way, or too many requests wait",
    Code.UNAVAILABLE: "a sensor, a node or a user that it needs is not there",
    Code.NOT_RUNNING: "there is nothing to stop, to pause or to seek",
    Code.EXISTS: "the name is taken",
    Code.NOT_STILL: "the person moved for as long as the calibration was ready to wait",
    Code.FAILED: "it was tried and did not succeed; the message says why, and what helps",
    Code.INTERNAL: "an error in the service itself, which is also in its log",
}

User = Annotated[Str, StringConstraints(pattern=USER_PATTERN)]
RecordingName = Annotated[Str, StringConstraints(pattern=r"^[A-Za-z0-9_-]+$", max_length=100)]


class NoArguments(Body):
    """Nothing."""


class Time(Body):
    """The bus clock between the request's arrival and the answer's departure."""

    t: Nanoseconds


class OfUser(Body):
    """Whose calibration it is."""

    user: User | None = Field(default=None, description="nil: the service's own user")


class OfUserWithHeight(OfUser):
    """Whose calibration it is, and what a person knows by heart."""

    height: Annotated[float, Strict(), Field(gt=0.5, lt=2.6, json_schema_extra={"unit": "m"})] | None = Field(
        default=None, description="standing, without the headset; nil: measured by the headset"
    )


class RecordStart(Body):
    """A new recording."""

    name: RecordingName = Field(description="without folder and ending")
    raw: Bool = Field(default=False, description="with the sensors' own bytes and pictures")


class RecordingFile(Body):
    """Where it goes."""

    file: Str = Field(description="absolute path on the service's host")


class Recorded(Body):
    """What was recorded."""

    file: Str = Field(description="absolute path on the service's host")
    messages: Count
    dropped: Count = Field(description="messages that the recorder could not keep up with")
    duration: Seconds


class ReplayAttach(Body):
    """Where a replay listens."""

    endpoint: Str = Field(description="ZeroMQ endpoint on the service's host, which answers the `replay/...` requests")


class ReplaySeek(Body):
    """Where to go on."""

    position: Seconds = Field(description="since the recording's first message")


class ReplayRate(Body):
    """How fast."""

    rate: Annotated[float, Strict(), Field(gt=0.0, le=1000.0)] = Field(description="1 is as it was recorded")


class ReplayState(Body):
    """Where a replay is."""

    position: Seconds = Field(description="since the recording's first message")
    duration: Seconds = Field(description="of the whole recording")
    rate: Annotated[float, Strict(), Field(gt=0.0, le=1000.0)]
    paused: Bool
    published: Count = Field(description="messages, so far")


@dataclass(frozen=True, slots=True)
class Command:
    """One request. ``codes`` are those beyond what every request may be refused with."""

    args: type[Body]
    result: Any
    codes: tuple[Code, ...]
    does: str


GENERAL_CODES = (Code.BAD_REQUEST, Code.UNKNOWN_COMMAND, Code.BAD_ARGUMENTS, Code.BUSY, Code.INTERNAL)
"""What any request may be refused with."""

_CALIBRATION = (Code.UNAVAILABLE, Code.NOT_STILL, Code.FAILED)
_REPLAY = (Code.NOT_RUNNING,)

COMMANDS: dict[str, Command] = {
    "hello": Command(NoArguments, Session, (), "who serves this bus, and which version it speaks"),
    "time": Command(NoArguments, Time, (), "the bus clock, for parties that cannot read it"),
    "status": Command(NoArguments, Health, (), "what `sys/health` says, now"),
    "calibrate/floor": Command(OfUser, FloorCalibration, _CALIBRATION, "the floor's height, while the person stands"),
    "calibrate/heading": Command(
        OfUser, HeadingCalibration, _CALIBRATION, "forward and the IMUs' yaw, while the person looks ahead"
    ),
    "calibrate/body": Command(OfUserWithHeight, BodyCalibration, _CALIBRATION, "the person's measures"),
    "calibrate/mount": Command(
        OfUser, MountCalibration, _CALIBRATION, "the camera's mount, while feet stand and the head moves"
    ),
    "record/start": Command(
        RecordStart, RecordingFile, (Code.EXISTS, Code.FAILED), "a recording, into the recordings folder"
    ),
    "record/stop": Command(NoArguments, Recorded, (Code.NOT_RUNNING,), "ends and closes the recording"),
    "replay/attach": Command(
        ReplayAttach, NoArguments, (), "a replay in a process of its own can be asked there; the others are passed on"
    ),
    "replay/pause": Command(NoArguments, ReplayState, _REPLAY, "holds the replay"),
    "replay/resume": Command(NoArguments, ReplayState, _REPLAY, "goes on"),
    "replay/seek": Command(ReplaySeek, ReplayState, _REPLAY, "goes on from there"),
    "replay/rate": Command(ReplayRate, ReplayState, _REPLAY, "goes on at that speed"),
}
"""All requests of version 1 by name."""
