"""The JSON Schema of a topic's payload, for the channels of a recording."""

from __future__ import annotations

import json
from functools import cache
from typing import NamedTuple

from foottrack_protocol.errors import TopicError
from foottrack_protocol.schemas import message_schema
from foottrack_protocol.topics import split_topic


class ChannelSchema(NamedTuple):
    """Name and JSON Schema (UTF-8) of a channel's messages."""

    name: str
    text: bytes


UNKNOWN = ChannelSchema("foottrack.unknown", b'{"type":"object"}')
"""For a topic that the registry does not know: PlotJuggler refuses a file with a channel that has no schema."""


@cache
def channel_schema(topic: str) -> ChannelSchema:
    """The schema of a topic's payload."""
    try:
        _, entry = split_topic(topic)
    except TopicError:
        return UNKNOWN
    return ChannelSchema(f"foottrack.{entry.schema}", json.dumps(message_schema(entry), sort_keys=True).encode())
