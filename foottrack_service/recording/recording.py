"""What every recording gives, whatever its format."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

from foottrack_protocol import DecodeError, Message, Reason, decode
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.info import RecordingInfo, summarise


class Frame(NamedTuple):
    """One message as it was on the wire."""

    arrival: int
    """ns of the bus clock."""
    topic: bytes
    payload: bytes


class Recorded(NamedTuple):
    """One message, as it was on the wire and decoded."""

    arrival: int
    """ns of the bus clock."""
    topic: bytes
    payload: bytes
    message: Message


class Span(NamedTuple):
    """First and last arrival, ns."""

    first: int
    last: int

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return (self.last - self.first) * 1e-9


class Recording(ABC):
    """A recording that can be read, again and again. All methods raise RecordingError where the file is damaged."""

    format: ClassVar[Literal["mcap", "msgpack"]]

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    @abstractmethod
    def config_toml(self) -> str | None:
        """The settings it was made with; None when it carries none."""

    @abstractmethod
    def frames(self, since: int | None = None) -> Iterator[Frame]:
        """Frames in order of arrival, from arrival ``since`` [ns] on."""

    @abstractmethod
    def span(self) -> Span | None:
        """From when to when; None when it is empty."""

    def require_span(self) -> Span:
        """From when to when. Raises RecordingError when it is empty, too."""
        span = self.span()
        if span is None:
            raise RecordingError(self.path, "there is no message in it")
        return span

    def topics(self) -> frozenset[bytes]:
        """Topics that occur."""
        return frozenset(frame.topic for frame in self.frames())

    def messages(self, since: int | None = None) -> Iterator[Recorded]:
        """Messages in order of arrival; streams that this version does not know are left out.

        Raises RecordingError for a payload that is no message.
        """
        for frame in self.frames(since):
            try:
                yield Recorded(*frame, decode((frame.topic, frame.payload)))
            except DecodeError as error:
                if error.reason is not Reason.TOPIC:
                    raise RecordingError(self.path, f"message that arrived at {frame.arrival} ns: {error}") from None

    @cached_property
    def info(self) -> RecordingInfo:
        """What is in it: reads all of it."""
        return summarise(self)
