"""Salvages a torn or damaged recording, and says what was lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from foottrack_protocol import DecodeError, decode
from foottrack_service.recording.bare import BareRecording
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.file import RecordingFile
from foottrack_service.recording.info import SequenceGaps
from foottrack_service.recording.reader import Frame, Recording, open_recording
from foottrack_service.recording.salvage import McapSalvage


@dataclass(slots=True)
class Recovered:
    """What came of a salvage."""

    messages: int = 0
    first: int | None = None
    """Arrival, ns."""
    last: int | None = None
    has_config: bool = False
    damage: list[tuple[int | None, str]] = field(default_factory=list)
    """Places in the file (bytes) and what was wrong there."""
    lost_bytes: int = 0
    """Bytes of the file that hold nothing that could be used."""
    lost_messages: int | None = None
    """Exactly, where the file's own count of its messages survived; None when it is not known."""
    gaps: int = 0
    """Messages missing by ``seq`` between those that were salvaged, whether lost here or never recorded."""

    @property
    def whole(self) -> bool:
        """Whether the file was as it should be."""
        return not self.damage


def recover(path: Path, out: Path) -> Recovered:
    """Salvage ``path`` into the new recording ``out``, which is not made when there is nothing in it.

    Raises RecordingError when ``path`` cannot be opened or is no recording, or when ``out`` cannot be written.
    """
    recording = open_recording(path)
    report = Recovered()
    if isinstance(recording, BareRecording):
        _copy(_bare_frames(recording, report), None, out, report)
        return report
    strict = _first_error(recording)
    with McapSalvage(path) as salvage:
        _copy(salvage.frames(), salvage.config_toml, out, report)
        report.has_config = salvage.config_toml is not None
        report.damage = list(salvage.damage)
        if strict is not None and strict.offset not in [offset for offset, _ in report.damage]:
            report.damage.append((strict.offset, strict.detail))
        report.lost_bytes = salvage.lost_bytes
        if report.whole:
            report.lost_messages = 0
        elif salvage.message_count is not None:
            report.lost_messages = salvage.message_count - report.messages
    return report


def _first_error(recording: Recording) -> RecordingError | None:
    try:
        for _ in recording.frames():
            pass
    except RecordingError as error:
        return error
    return None


def _copy(frames: Iterator[Frame], config_toml: str | None, out: Path, report: Recovered) -> None:
    first = next(frames, None)
    if first is None:
        return
    gaps = SequenceGaps()
    report.first = first.arrival
    with RecordingFile(out, config_toml) as file:
        for frame in _with_first(first, frames):
            publish_time, sequence = 0, 0
            try:
                message = decode((frame.topic, frame.payload))
                publish_time, sequence = message.t_pub, message.seq
                report.gaps += gaps.missing_before(message)
            except DecodeError:
                pass  # a stream of another version: kept as it is
            file.add(frame.topic, frame.payload, frame.arrival, publish_time, sequence)
            report.last = frame.arrival
        report.messages = file.messages


def _with_first(first: Frame, rest: Iterator[Frame]) -> Iterator[Frame]:
    yield first
    yield from rest


def _bare_frames(recording: BareRecording, report: Recovered) -> Iterator[Frame]:
    reached = 0
    try:
        for end, frame in recording.placed_frames():
            try:
                decode((frame.topic, frame.payload))
            except DecodeError as error:
                report.damage.append((reached, str(error)))
                report.lost_bytes += end - reached
            else:
                yield frame
            reached = end
    except RecordingError as error:
        report.damage.append((error.offset, error.detail))
        report.lost_bytes += recording.path.stat().st_size - reached
