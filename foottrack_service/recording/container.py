"""MCAP's records with every checksum checked, and the place of whatever is wrong.

The library's stream reader neither tells where it is nor checks the summary's and the attachments' checksums, and
skips a record whose opcode was hit; so the framing is read here, and the library's record classes parse the rare ones.
Format: https://mcap.dev/spec
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, DataEnd, Footer, Header
from mcap.writer import MCAP0_MAGIC

from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.file import LIBRARY

MAX_CHUNK_BYTES = 1 << 30
"""Uncompressed; a damaged size must not ask for all memory."""

_HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_MESSAGE = struct.Struct("<HIQQ")
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_FOOTER_CRC_BYTES = 4

T = TypeVar("T")


class Record(NamedTuple):
    """One record of a file."""

    offset: int
    """Of its opcode, in the file."""
    opcode: int
    content: bytes


class Chunk(NamedTuple):
    """A chunk's header, and its records still compressed."""

    start: int
    """Least log time, ns."""
    end: int
    """Greatest log time, ns."""
    size: int
    """Uncompressed, bytes."""
    crc: int
    """Of the uncompressed records; 0 when there is none."""
    compression: str
    data: bytes


class RawMessage(NamedTuple):
    """A message of a chunk."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    payload: bytes


def records(stream: BinaryIO, path: Path) -> Iterator[Record]:
    """All records in file order. Raises RecordingError as soon as something cannot be right.

    What the data section's checksum alone protects (the chunks' headers) is only known to be right at its end.
    """
    size = os.fstat(stream.fileno()).st_size
    magic = stream.read(len(MCAP0_MAGIC))
    if magic != MCAP0_MAGIC:
        raise RecordingError(path, "no MCAP file: its first bytes are wrong", 0)
    offset = len(magic)
    crc = zlib.crc32(magic)
    demanding = False
    data_ended = False
    while True:
        head = stream.read(_HEAD.size)
        if len(head) < _HEAD.size:
            raise RecordingError(path, "the file ends here, torn", offset)
        opcode, length = _HEAD.unpack(head)
        if opcode == 0 or offset + _HEAD.size + length > size:
            raise RecordingError(path, f"a record of kind {opcode} and {length} bytes: torn or damaged", offset)
        record = Record(offset, opcode, stream.read(length))
        if offset == len(magic):
            demanding = _begins_ours(record, path)
        if opcode == Opcode.DATA_END:
            if data_ended:
                raise RecordingError(path, "a second end of the data section", offset)
            stored = parse(DataEnd.read, record, path).data_section_crc
            _check(stored, crc, demanding, path, offset, f"the data section, bytes 0 to {offset},")
            data_ended = True
            crc = 0
        elif opcode == Opcode.FOOTER:
            if not data_ended:
                raise RecordingError(path, "the data section's end is missing before the footer", offset)
            covered = zlib.crc32(record.content[:-_FOOTER_CRC_BYTES], zlib.crc32(head, crc))
            _check(parse(Footer.read, record, path).summary_crc, covered, demanding, path, offset, "the summary")
            yield record
            break
        else:
            crc = zlib.crc32(record.content, zlib.crc32(head, crc))
        yield record
        offset += _HEAD.size + length
    if stream.read(len(MCAP0_MAGIC) + 1) != MCAP0_MAGIC:
        raise RecordingError(path, "the file does not end as an MCAP file must", offset + _HEAD.size + length)


def parse(read: Callable[[ReadDataStream], T], record: Record, path: Path) -> T:
    """A record's content by one of the library's classes. Raises RecordingError."""
    try:
        return read(ReadDataStream(BytesIO(record.content)))
    except (McapError, struct.error, UnicodeDecodeError, MemoryError, OverflowError) as error:
        raise RecordingError(path, f"unreadable record of kind {record.opcode}: {error}", record.offset) from error


def attachment(record: Record, path: Path) -> Attachment:
    """An attachment, its checksum checked. Raises RecordingError."""
    parsed: Attachment = parse(Attachment.read, record, path)
    stored = _U32.unpack(record.content[-4:])[0]
    if stored not in (0, zlib.crc32(record.content[:-4])):
        raise RecordingError(path, f"the checksum of attachment {parsed.name!r} does not match", record.offset)
    return parsed


def chunk(record: Record, path: Path) -> Chunk:
    """A chunk's header and data, not yet checked. Raises RecordingError."""
    content = record.content
    try:
        start, end, size, crc, name_length = _CHUNK_HEAD.unpack_from(content)
        at = _CHUNK_HEAD.size + name_length
        compression = content[_CHUNK_HEAD.size : at].decode()
        (length,) = _U64.unpack_from(content, at)
    except (struct.error, UnicodeDecodeError) as error:
        raise RecordingError(path, f"unreadable chunk: {error}", record.offset) from None
    data = content[at + _U64.size :]
    if len(data) != length:
        raise RecordingError(path, f"a chunk of {len(data)} bytes says that it has {length}", record.offset)
    return Chunk(start, end, size, crc, compression, data)


def decompress(packed: Chunk, path: Path, offset: int) -> bytes:
    """A chunk's records, checked against its checksum. Raises RecordingError."""
    if packed.size > MAX_CHUNK_BYTES:
        raise RecordingError(path, f"a chunk says that it unpacks to {packed.size} bytes", offset)
    if packed.compression == "zstd":
        try:
            if zstandard.frame_content_size(packed.data) not in (-1, packed.size):
                raise RecordingError(path, "a chunk's two notes of its size differ", offset)
            data = zstandard.ZstdDecompressor().decompress(packed.data, max_output_size=packed.size)
        except zstandard.ZstdError as error:
            raise RecordingError(path, f"a chunk cannot be decompressed: {error}", offset) from None
    elif packed.compression == "":
        data = packed.data
    else:
        raise RecordingError(path, f"compression {packed.compression!r} is not supported (zstd is)", offset)
    if len(data) != packed.size:
        raise RecordingError(path, f"a chunk of {packed.size} bytes unpacks to {len(data)}", offset)
    if packed.crc not in (0, zlib.crc32(data)):
        raise RecordingError(path, "a chunk's checksum does not match its data", offset)
    return data


def chunk_records(data: bytes, path: Path, offset: int) -> Iterator[Record]:
    """The records inside a chunk; their offset is the chunk's. Raises RecordingError."""
    at, end = 0, len(data)
    unpack, head = _HEAD.unpack_from, _HEAD.size
    while at < end:
        if end - at < head:
            raise RecordingError(path, "a chunk ends within a record", offset)
        opcode, length = unpack(data, at)
        at += head
        if length > end - at:
            raise RecordingError(path, "a chunk ends within a record", offset)
        yield Record(offset, opcode, data[at : at + length])
        at += length


def raw_message(record: Record, path: Path) -> RawMessage:
    """A message record. Raises RecordingError."""
    if len(record.content) < _MESSAGE.size:
        raise RecordingError(path, "a message record is too short", record.offset)
    channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(record.content)
    return RawMessage(channel, sequence, log_time, publish_time, record.content[_MESSAGE.size :])


def _begins_ours(record: Record, path: Path) -> bool:
    """Whether our own writer made the file, which always writes checksums."""
    if record.opcode != Opcode.HEADER:
        raise RecordingError(path, "the first record is not a header", record.offset)
    header: Header = parse(Header.read, record, path)
    return header.library.startswith(f"{LIBRARY} ")


def _check(stored: int, computed: int, demanding: bool, path: Path, offset: int, what: str) -> None:
    if stored != computed and (stored != 0 or demanding):
        raise RecordingError(path, f"{what} does not match its checksum: a bit was flipped, or it was edited", offset)
