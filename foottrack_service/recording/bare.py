"""Bare msgpack streams: maps ``{"topic", "log_time", ...envelope}``, one after the other.

The envelope's bytes are carried over as they are: exported and imported again, a payload is the same to the bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

import msgpack

from foottrack_protocol import MAX_PAYLOAD_BYTES
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.recording import Frame, Recording, Span

TOPIC = "topic"
LOG_TIME = "log_time"
_ADDED_KEYS = 2
_READ_BYTES = 1 << 20
_FIXMAP, _MAP16, _MAP32 = 0x80, 0xDE, 0xDF
_FIXMAP_MAX = 15


class _Head(NamedTuple):
    entries: int
    size: int
    """Bytes of the map's head."""


def to_bare(frame: Frame) -> bytes:
    """The map of one frame. Raises ValueError when the payload is no msgpack map."""
    head = _read_head(frame.payload)
    packer = msgpack.Packer()
    added = b"".join(packer.pack(item) for item in (TOPIC, frame.topic.decode(), LOG_TIME, frame.arrival))
    return _write_head(head.entries + _ADDED_KEYS, head.size) + added + frame.payload[head.size :]


class BareRecording(Recording):
    """A bare stream. It has no checksums and no settings: damage shows only where the bytes no longer decode."""

    format = "msgpack"

    @cached_property
    def config_toml(self) -> str | None:
        """None: a bare stream carries no settings."""
        return None

    def frames(self, since: int | None = None) -> Iterator[Frame]:
        """Frames in file order."""
        for _, frame in self.placed_frames():
            if since is None or frame.arrival >= since:
                yield frame

    def placed_frames(self) -> Iterator[tuple[int, Frame]]:
        """Frames, each with the offset in the file where it ends, bytes."""
        with self.path.open("rb") as stream:
            pending = b""
            offset = 0
            while more := stream.read(_READ_BYTES):
                pending += more
                at = 0
                for end in self._ends(pending, offset):
                    yield offset + end, self._frame(pending[at:end], offset + at)
                    at = end
                pending = pending[at:]
                offset += at
                if len(pending) > 2 * MAX_PAYLOAD_BYTES + _READ_BYTES:
                    raise RecordingError(self.path, "a value larger than any message", offset)
            if pending:
                raise RecordingError(self.path, "the last message is torn", offset)

    def span(self) -> Span | None:
        """From the first to the last arrival: reads all of it."""
        first = last = None
        for frame in self.frames():
            first = frame.arrival if first is None else min(first, frame.arrival)
            last = frame.arrival if last is None else max(last, frame.arrival)
        return None if first is None or last is None else Span(first, last)

    def _ends(self, data: bytes, offset: int) -> Iterator[int]:
        unpacker = msgpack.Unpacker(max_buffer_size=len(data) + 1)
        unpacker.feed(data)
        while True:
            try:
                unpacker.skip()
            except msgpack.OutOfData:
                return
            except Exception as error:  # msgpack raises a dozen kinds
                at = offset + unpacker.tell()
                raise RecordingError(self.path, f"no msgpack: {type(error).__name__}: {error}", at) from None
            yield unpacker.tell()

    def _frame(self, raw: bytes, offset: int) -> Frame:
        try:
            topic, arrival, payload = _split(raw)
        except (ValueError, msgpack.UnpackException) as error:
            raise RecordingError(self.path, str(error) or type(error).__name__, offset) from None
        if type(topic) is not str:
            raise RecordingError(self.path, "a message without its topic", offset)
        if type(arrival) is not int or not 0 <= arrival < 2**63:
            raise RecordingError(self.path, "a message without log_time, ns", offset)
        return Frame(arrival, topic.encode(errors="surrogatepass"), payload)


def _split(raw: bytes) -> tuple[Any, Any, bytes]:
    """Topic, log time and envelope of one map; the envelope's own bytes when our two keys come first."""
    head = _read_head(raw)
    if head.entries < _ADDED_KEYS:
        raise ValueError("a map without topic and log_time")
    unpacker = msgpack.Unpacker(max_buffer_size=len(raw))
    unpacker.feed(raw)
    unpacker.read_map_header()
    first, topic, second, arrival = (unpacker.unpack() for _ in range(2 * _ADDED_KEYS))
    if (first, second) == (TOPIC, LOG_TIME):
        entries = head.entries - _ADDED_KEYS
        grown = head.entries > _FIXMAP_MAX >= entries
        return topic, arrival, _write_head(entries, 1 if grown else head.size) + raw[unpacker.tell() :]
    value = msgpack.unpackb(raw)
    topic, arrival = value.pop(TOPIC, None), value.pop(LOG_TIME, None)
    return topic, arrival, msgpack.packb(value)


def _read_head(packed: bytes) -> _Head:
    kind = packed[0] if packed else 0
    if kind & 0xF0 == _FIXMAP:
        return _Head(kind & 0x0F, 1)
    size = {_MAP16: 3, _MAP32: 5}.get(kind)
    if size is None or len(packed) < size:
        raise ValueError("a msgpack map is due")
    return _Head(int.from_bytes(packed[1:size], "big"), size)


def _write_head(entries: int, size: int) -> bytes:
    """A map's head of at least ``size`` bytes: a peer's wider head than needed is kept."""
    if size == 1 and entries <= _FIXMAP_MAX:
        return bytes([_FIXMAP | entries])
    if size <= 3 and entries < 1 << 16:
        return bytes([_MAP16]) + entries.to_bytes(2, "big")
    return bytes([_MAP32]) + entries.to_bytes(4, "big")
