"""What is in a recording: topics, rates, gaps, duration, and what the calibration was."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from foottrack_protocol import DecodeError, Message, decode
from foottrack_protocol.topics import SYSTEM

if TYPE_CHECKING:
    from foottrack_service.recording.recording import Frame, Recording


@dataclass(slots=True)
class TopicInfo:
    """One topic of a recording."""

    messages: int = 0
    payload_bytes: int = 0
    invalid: int = 0
    """Messages whose publisher said ``valid: false``."""
    lost: int = 0
    """Messages missing by ``seq``."""
    undecodable: dict[str, int] = field(default_factory=dict)
    """Payloads that are no message, by reason."""
    first: int = 0
    """Arrival, ns."""
    last: int = 0
    longest_gap_s: float = 0.0
    sources: list[str] = field(default_factory=list)

    @property
    def hz(self) -> float | None:
        """Mean rate; None for fewer than two messages."""
        return (self.messages - 1) / ((self.last - self.first) * 1e-9) if self.last > self.first else None


@dataclass(slots=True)
class RecordingInfo:
    """All of a recording in a few figures. Stamps are arrivals, ns of the bus clock."""

    path: str
    format: str
    file_bytes: int
    messages: int = 0
    payload_bytes: int = 0
    first: int | None = None
    last: int | None = None
    begun_unix_ns: int | None = None
    """By the first ``sys/session`` that tells the clocks apart."""
    has_config: bool = False
    topics: dict[str, TopicInfo] = field(default_factory=dict)
    calibration: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The last of each kind, by ``<user>/<kind>`` (``imu`` per side)."""

    @property
    def duration_s(self) -> float:
        """From the first to the last arrival."""
        return 0.0 if self.first is None or self.last is None else (self.last - self.first) * 1e-9


class SequenceGaps:
    """Counts missing messages by ``seq``; a new run of a publisher (``sid``) starts anew."""

    def __init__(self) -> None:
        self._expected: dict[tuple[str, str, str, str], int] = {}

    def missing_before(self, message: Message) -> int:
        """How many are missing between the last message of the same source and topic and this one."""
        key = (message.user, message.stream, message.src, message.sid)
        expected = self._expected.get(key, message.seq)
        self._expected[key] = max(message.seq + 1, expected)
        return max(message.seq - expected, 0)


def summarise(recording: Recording) -> RecordingInfo:
    """Read all of a recording. Raises RecordingError where it is damaged."""
    info = RecordingInfo(str(recording.path), recording.format, recording.path.stat().st_size)
    info.has_config = recording.config_toml is not None
    fold(info, recording.frames())
    return info


def fold(info: RecordingInfo, frames: Iterable[Frame]) -> None:
    """Add frames, in order of arrival, to ``info``."""
    gaps = SequenceGaps()
    topics: dict[bytes, TopicInfo] = {}
    anchors: list[int] = []
    for frame in frames:
        entry = topics.get(frame.topic)
        if entry is None:
            entry = topics[frame.topic] = info.topics.setdefault(frame.topic.decode(errors="replace"), TopicInfo())
        _arrived(info, entry, frame)
        try:
            message = decode((frame.topic, frame.payload))
        except DecodeError as error:
            entry.undecodable[error.reason] = entry.undecodable.get(error.reason, 0) + 1
            continue
        entry.lost += gaps.missing_before(message)
        entry.invalid += not message.valid
        if message.src not in entry.sources:
            entry.sources.append(message.src)
        if message.stream == "calibration":
            _calibrated(info, message)
        elif not anchors and (message.user, message.stream) == (SYSTEM, "session"):
            anchors.append(message.data.clock.unix - message.data.clock.bus)
    if anchors and info.first is not None:
        info.begun_unix_ns = info.first + anchors[0]


def _arrived(info: RecordingInfo, entry: TopicInfo, frame: Frame) -> None:
    arrival, size = frame.arrival, len(frame.payload)
    if entry.messages == 0:
        entry.first = entry.last = arrival
    entry.longest_gap_s = max(entry.longest_gap_s, (arrival - entry.last) * 1e-9)
    entry.last = max(entry.last, arrival)
    entry.messages += 1
    entry.payload_bytes += size
    info.messages += 1
    info.payload_bytes += size
    info.first = arrival if info.first is None else min(info.first, arrival)
    info.last = arrival if info.last is None else max(info.last, arrival)


def _calibrated(info: RecordingInfo, message: Message) -> None:
    kind, values = message.data.kind, message.data.values
    name = f"{kind}/{values.side}" if kind == "imu" else kind
    info.calibration[f"{message.user}/{name}"] = values.model_dump(mode="json")
