"""An MCAP file being written, without a thread and without a clock: the one place that knows how ours are laid out."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from mcap.writer import CompressionType, Writer

from foottrack_service.recording.errors import RecordingError, WriteError
from foottrack_service.recording.schemas import ChannelSchema, channel_schema

PROFILE = "foottrack"
LIBRARY = "foottrack"
CONFIG_NAME = "foottrack.toml"
PART_SUFFIX = ".part"
MESSAGE_ENCODING = "msgpack"
SCHEMA_ENCODING = "jsonschema"
CHUNK_BYTES = 256 * 1024
"""Before compression. Larger chunks hold the writing thread for tens of milliseconds."""

Opener = Callable[[Path], BinaryIO]


class RecordingFile:
    """Writes ``<path>.part`` and renames it to ``path`` when it is finished.

    The payloads are the wire's bytes, unchanged. ``config_toml`` None writes no attachment. The same calls give the
    same bytes. Raises RecordingError when the file or its part exists already or cannot be made.
    """

    def __init__(self, path: Path, config_toml: str | None, created: int = 0, opener: Opener | None = None) -> None:
        self.path = path
        self.part = path.with_name(path.name + PART_SUFFIX)
        self.messages = 0
        self._channels: dict[bytes, int] = {}
        self._schemas: dict[ChannelSchema, int] = {}
        for taken in (self.path, self.part):
            if taken.exists():
                raise RecordingError(taken, "exists already, and recordings are never overwritten")
        try:
            self._stream = (opener or _create)(self.part)
        except OSError as error:
            raise RecordingError(self.part, f"cannot be written: {error.strerror or error}") from error
        self._writer = Writer(
            self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        try:
            self._writer.start(PROFILE, f"{LIBRARY} {version('foottrack')}")
            if config_toml is not None:
                self._writer.add_attachment(created, created, CONFIG_NAME, "application/toml", config_toml.encode())
            self._stream.flush()
        except OSError as error:
            raise self._refused(error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.finish()
        else:
            self.abandon()

    def add(self, topic: bytes, payload: bytes, arrival: int, publish_time: int, sequence: int) -> None:
        """Append a message; ``arrival`` and ``publish_time`` in ns of the bus clock.

        MCAP's ``sequence`` has 32 bits and its stamps have no sign; the payload has the true ones. Raises
        WriteError.
        """
        try:
            channel = self._channels.get(topic)
            if channel is None:
                channel = self._channels[topic] = self._register(topic)
            self._writer.add_message(channel, max(arrival, 0), payload, max(publish_time, 0), sequence & 0xFFFFFFFF)
        except OSError as error:
            raise self._refused(error) from error
        self.messages += 1

    def flush(self) -> None:
        """Close the chunk and bring everything to the disk. Raises WriteError."""
        try:
            self._writer.flush()  # type: ignore[no-untyped-call]
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise self._refused(error) from error

    def finish(self) -> None:
        """Write the summary and take the name ``path``. Raises WriteError."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.flush()
            os.fsync(self._stream.fileno())
            self._stream.close()
            self.part.replace(self.path)
            _sync_folder(self.path.parent)
        except OSError as error:
            raise self._refused(error) from error

    def abandon(self) -> None:
        """Close the file as it is: a torn ``.part``, of which ``recover`` brings what was flushed."""
        try:
            self._stream.close()
        except OSError:  # the buffer's rest does not fit either
            return

    @property
    def bytes_written(self) -> int:
        """Size of the file so far."""
        return self._stream.tell()

    def _register(self, topic: bytes) -> int:
        name = topic.decode(errors="backslashreplace")
        schema = channel_schema(name)
        schema_id = self._schemas.get(schema)
        if schema_id is None:
            schema_id = self._writer.register_schema(schema.name, SCHEMA_ENCODING, schema.text)
            self._schemas[schema] = schema_id
        return self._writer.register_channel(name, MESSAGE_ENCODING, schema_id)

    def _refused(self, error: OSError) -> WriteError:
        self.abandon()
        return WriteError(self.part, f"{error.strerror or error}; what was flushed can be recovered")


def _create(path: Path) -> BinaryIO:
    return path.open("xb")


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":  # a folder cannot be opened there, and the rename is journalled
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
