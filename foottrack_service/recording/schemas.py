"""The JSON Schema of a topic's payload, for the channels of a recording: the envelope around the registry's body."""

from __future__ import annotations

import json
from functools import cache
from typing import Any, NamedTuple

from foottrack_protocol.errors import TopicError
from foottrack_protocol.topics import SYSTEM_TOPICS, TOPICS, Topic, split_topic


class ChannelSchema(NamedTuple):
    """Name and JSON Schema (UTF-8) of a channel's messages."""

    name: str
    text: bytes


UNKNOWN = ChannelSchema("foottrack.unknown", b'{"type":"object"}')
"""For a topic that the registry does not know: PlotJuggler refuses a file with a channel that has no schema."""


def channel_schema(topic: str) -> ChannelSchema:
    """The schema of a topic's payload."""
    try:
        _, entry = split_topic(topic)
    except TopicError:
        return UNKNOWN
    return _of_entry(entry.stream, entry.is_system)


@cache
def _of_entry(stream: str, is_system: bool) -> ChannelSchema:
    entry = (SYSTEM_TOPICS if is_system else TOPICS)[stream]
    return ChannelSchema(f"foottrack.{entry.schema}", json.dumps(_envelope(entry), sort_keys=True).encode())


def _envelope(entry: Topic) -> dict[str, Any]:
    body = entry.adapter.json_schema(mode="serialization")
    definitions = body.pop("$defs", {})
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "type": "object",
        "properties": {
            "v": {"type": "integer"},
            "src": {"type": "string"},
            "sid": {"type": "string"},
            "seq": {"type": "integer"},
            "t": {"type": "integer", "description": "ns"},
            "t_pub": {"type": "integer", "description": "ns"},
            "valid": {"type": "boolean"},
            "data": body,
        },
        "required": ["v", "src", "sid", "seq", "t", "t_pub", "valid", "data"],
        "$defs": definitions,
    }
