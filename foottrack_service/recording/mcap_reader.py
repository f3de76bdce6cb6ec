"""Recordings in MCAP, our own and those that other tools rewrote."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from mcap.opcode import Opcode
from mcap.records import Channel

from foottrack_service.recording import container
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.file import CONFIG_NAME, MESSAGE_ENCODING
from foottrack_service.recording.recording import Frame, Recording, Span

Topics = dict[int, bytes | None]
"""By channel; None where a channel's messages are no msgpack and are left out."""


class McapRecording(Recording):
    """An MCAP file whose messages are msgpack."""

    format = "mcap"

    @cached_property
    def config_toml(self) -> str | None:
        """The attachment ``foottrack.toml``, None when there is none."""
        for record in self._records():
            if record.opcode == Opcode.ATTACHMENT:
                found = container.attachment(record, self.path)
                if found.name == CONFIG_NAME:
                    return self._text(found.data, record.offset)
        return None

    def frames(self, since: int | None = None) -> Iterator[Frame]:
        """Frames in file order, which is the order of arrival."""
        # Chunks before ``since`` are stepped over where the summary says what they would have announced.
        topics = {} if since is None else dict(self._summary_topics)
        skipping = bool(topics)
        earliest = 0 if since is None else since
        for record in self._records():
            if record.opcode == Opcode.CHUNK:
                packed = container.chunk(record, self.path)
                if skipping and packed.end < earliest:
                    continue
                data = container.decompress(packed, self.path, record.offset)
                for inner in container.chunk_records(data, self.path, record.offset):
                    if inner.opcode == Opcode.MESSAGE:
                        frame = self._frame(inner, topics)
                        if frame is not None and frame.arrival >= earliest:
                            yield frame
                    elif inner.opcode == Opcode.CHANNEL:
                        self._announce(inner, topics)
            elif record.opcode == Opcode.MESSAGE:
                frame = self._frame(record, topics)
                if frame is not None and frame.arrival >= earliest:
                    yield frame
            elif record.opcode == Opcode.CHANNEL:
                self._announce(record, topics)
            elif record.opcode == Opcode.ATTACHMENT:
                container.attachment(record, self.path)

    def span(self) -> Span | None:
        """From when to when, by the chunks' headers and the messages outside chunks; None when it is empty."""
        stamps: list[int] = []
        for record in self._records():
            if record.opcode == Opcode.CHUNK:
                packed = container.chunk(record, self.path)
                stamps = [min([*stamps, packed.start]), max([*stamps, packed.end])]
            elif record.opcode == Opcode.MESSAGE:
                arrival = container.raw_message(record, self.path).log_time
                stamps = [min([*stamps, arrival]), max([*stamps, arrival])]
        return Span(stamps[0], stamps[1]) if stamps else None

    def topics(self) -> frozenset[bytes]:
        """Topics, by the summary where there is one."""
        if self._summary_topics:
            return frozenset(topic for topic in self._summary_topics.values() if topic is not None)
        return super().topics()

    @cached_property
    def _summary_topics(self) -> Topics:
        topics: Topics = {}
        for record in self._records():
            if record.opcode == Opcode.CHANNEL:
                self._announce(record, topics)
        return topics

    def _records(self) -> Iterator[container.Record]:
        with self.path.open("rb") as stream:
            yield from container.records(stream, self.path)

    def _frame(self, record: container.Record, topics: Topics) -> Frame | None:
        message = container.raw_message(record, self.path)
        try:
            topic = topics[message.channel]
        except KeyError:
            detail = f"message of channel {message.channel}, which was never announced"
            raise RecordingError(self.path, detail, record.offset) from None
        return None if topic is None else Frame(message.log_time, topic, message.payload)

    def _announce(self, record: container.Record, topics: Topics) -> None:
        channel = container.parse(Channel.read, record, self.path)
        topics[channel.id] = channel.topic.encode() if channel.message_encoding == MESSAGE_ENCODING else None

    def _text(self, data: bytes, offset: int) -> str:
        try:
            return data.decode()
        except UnicodeDecodeError as error:
            raise RecordingError(self.path, f"attachment {CONFIG_NAME} is no UTF-8: {error}", offset) from None
