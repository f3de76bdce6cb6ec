"""Opens a recording, whatever its format."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mcap.writer import MCAP0_MAGIC

from foottrack_service.recording.bare import BareRecording
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.mcap_reader import McapRecording
from foottrack_service.recording.recording import Frame, Recorded, Recording, Span

__all__ = ["Frame", "Recorded", "Recording", "Span", "open_recording", "read"]

_MAP_HEADS = frozenset([*range(0x80, 0x90), 0xDE, 0xDF])


def open_recording(path: Path) -> Recording:
    """An MCAP file or a bare msgpack stream, told apart by content. Raises RecordingError when it is neither."""
    try:
        with path.open("rb") as stream:
            begin = stream.read(len(MCAP0_MAGIC))
    except OSError as error:
        raise RecordingError(path, error.strerror or str(error)) from None
    # One byte of the magic may be hit: its first is a msgpack map's head too.
    alike = sum(a == b for a, b in zip(begin, MCAP0_MAGIC, strict=False))
    if alike >= len(MCAP0_MAGIC) - 2:
        return McapRecording(path)
    if not begin:
        raise RecordingError(path, "the file is empty")
    if begin[0] in _MAP_HEADS:
        return BareRecording(path)
    raise RecordingError(path, "neither an MCAP file nor a bare msgpack stream", 0)


def read(path: Path) -> Iterator[Recorded]:
    """The messages of a recording in order of arrival. Raises RecordingError where it is damaged."""
    yield from open_recording(path).messages()
