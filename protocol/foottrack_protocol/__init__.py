"""The wire of foottrack, version 1: messages, topics and the codec. Needs msgpack and pydantic only.

``SPEC.md`` beside this package is the contract in words; this package is that contract in Python.
"""

from foottrack_protocol.envelope import (
    MAX_DEPTH,
    MAX_PAYLOAD_BYTES,
    PROTOCOL_MAJOR,
    PROTOCOL_MINOR,
    Message,
    decode,
    encode,
)
from foottrack_protocol.errors import DecodeError, EncodeError, ProtocolError, Reason, TopicError
from foottrack_protocol.topics import TOPICS, Policy, Role, Topic, split_topic, topic_name

__all__ = [
    "MAX_DEPTH",
    "MAX_PAYLOAD_BYTES",
    "PROTOCOL_MAJOR",
    "PROTOCOL_MINOR",
    "TOPICS",
    "DecodeError",
    "EncodeError",
    "Message",
    "Policy",
    "ProtocolError",
    "Reason",
    "Role",
    "Topic",
    "TopicError",
    "decode",
    "encode",
    "split_topic",
    "topic_name",
]
