"""What is still right in an MCAP file that is not.

Only whole chunks whose checksum matches are taken. Where the framing is damaged, the next chunk is found by its looks.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.opcode import Opcode
from mcap.records import Channel, Statistics
from mcap.writer import MCAP0_MAGIC

from foottrack_service.recording import container
from foottrack_service.recording.container import Record
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.file import CONFIG_NAME, MESSAGE_ENCODING
from foottrack_service.recording.recording import Frame

_HEAD = struct.Struct("<BQ")
_KNOWN = frozenset(int(opcode) for opcode in Opcode)
_COMPRESSION = struct.pack("<I", len("zstd")) + b"zstd"
_COMPRESSION_AT = _HEAD.size + 28
"""Where a chunk names its compression, from its opcode on: what a chunk is known by when its head was hit."""


class McapSalvage:
    """Two passes over a damaged file: one for what the messages need, one for the messages.

    Attributes: ``config_toml`` (None when it did not survive), ``damage`` (offset, what), ``lost_bytes``,
    ``message_count`` as the file's own statistics have it, or None.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.config_toml: str | None = None
        self.damage: list[tuple[int | None, str]] = []
        self.lost_bytes = 0
        self.message_count: int | None = None
        self._topics: dict[int, bytes] = {}
        self._stream = path.open("rb")
        self._data = mmap.mmap(self._stream.fileno(), 0, access=mmap.ACCESS_READ)
        self._prepare()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._data.close()
        self._stream.close()

    def frames(self) -> Iterator[Frame]:
        """The messages of all chunks that are whole, in file order."""
        nameless = 0
        for _, inside in self._records():
            for inner in inside or ():
                if inner.opcode == Opcode.MESSAGE:
                    message = container.raw_message(inner, self.path)
                    topic = self._topics.get(message.channel)
                    if topic is None:
                        nameless += 1
                    else:
                        yield Frame(message.log_time, topic, message.payload)
        if nameless:
            self.damage.append((None, f"{nameless} messages are lost: what named their topic is"))

    def _prepare(self) -> None:
        in_summary: dict[int, bytes] = {}
        for record, inside in self._records():
            if inside is not None:
                for inner in inside:
                    if inner.opcode == Opcode.CHANNEL:
                        self._announce(inner, self._topics)
                continue
            try:
                if record.opcode == Opcode.ATTACHMENT:
                    found = container.attachment(record, self.path)
                    if found.name == CONFIG_NAME:
                        self.config_toml = found.data.decode(errors="replace")
                elif record.opcode == Opcode.CHANNEL:
                    self._announce(record, in_summary)
                elif record.opcode == Opcode.STATISTICS:
                    self.message_count = container.parse(Statistics.read, record, self.path).message_count
            except RecordingError as error:
                self.damage.append((error.offset, error.detail))
        self._topics = {**in_summary, **self._topics}
        self.lost_bytes = sum(end - at for at, end in self._holes)

    def _records(self) -> Iterator[tuple[Record, list[Record] | None]]:
        """Records, with those inside where it is a chunk; what is damaged is noted and stepped over."""
        data, size = self._data, len(self._data)
        self._holes: list[tuple[int, int]] = []
        at = len(MCAP0_MAGIC)
        ended = False
        while at < size and not (ended and data[at:] == MCAP0_MAGIC):
            record = self._record_at(at)
            inside = None
            wrong = "" if record else "no record"
            if record is not None and record.opcode == Opcode.CHUNK:
                try:
                    unpacked = container.decompress(container.chunk(record, self.path), self.path, at)
                    inside = list(container.chunk_records(unpacked, self.path, at))
                except RecordingError as error:
                    record, wrong = None, error.detail
            if record is None:
                after = self._next_chunk(at + 1)
                self._note(at, after, wrong)
                at = after
                continue
            ended = record.opcode == Opcode.FOOTER
            yield record, inside
            at += _HEAD.size + len(record.content)

    def _record_at(self, at: int) -> Record | None:
        if at + _HEAD.size > len(self._data):
            return None
        opcode, length = _HEAD.unpack_from(self._data, at)
        begin = at + _HEAD.size
        if length > len(self._data) - begin:
            return None
        if self._data[at + _COMPRESSION_AT : at + _COMPRESSION_AT + len(_COMPRESSION)] == _COMPRESSION:
            opcode = int(Opcode.CHUNK)
        return Record(at, opcode, self._data[begin : begin + length]) if opcode in _KNOWN else None

    def _next_chunk(self, at: int) -> int:
        found = self._data.find(_COMPRESSION, at + _COMPRESSION_AT)
        return len(self._data) if found < 0 else found - _COMPRESSION_AT

    def _note(self, at: int, after: int, wrong: str) -> None:
        self._holes.append((at, after))
        detail = f"{wrong}; {after - at} bytes are lost"
        if (at, detail) not in self.damage:
            self.damage.append((at, detail))

    def _announce(self, record: Record, topics: dict[int, bytes]) -> None:
        channel = container.parse(Channel.read, record, self.path)
        if channel.message_encoding == MESSAGE_ENCODING:
            topics.setdefault(channel.id, channel.topic.encode())
