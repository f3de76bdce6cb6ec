"""What can go wrong on the wire.

::

    ProtocolError
    ├── TopicError      a topic's name is not one of ours
    ├── EncodeError     a message that must not be sent (NaN, wrong body for its topic, too large)
    └── DecodeError     bytes that are not a message; ``reason`` says why, and is what receivers count by
"""

from __future__ import annotations

from enum import StrEnum

MAX_DETAIL = 200
"""Characters of a DecodeError's detail."""


class Reason(StrEnum):
    """Why bytes were not a message. The values appear in ``sys/health`` as the keys of ``drops``."""

    FRAMES = "frames"
    TOPIC = "topic"
    OVERSIZED = "oversized"
    MSGPACK = "msgpack"
    DEPTH = "depth"
    ENVELOPE = "envelope"
    VERSION = "version"
    NOT_FINITE = "not_finite"
    BODY = "body"


REASON_MEANINGS: dict[Reason, str] = {
    Reason.FRAMES: "not two frames",
    Reason.TOPIC: "the topic is too long, not UTF-8, malformed, or names no stream of this version",
    Reason.OVERSIZED: "the payload is too large",
    Reason.MSGPACK: "the payload is not one msgpack value within the limits, with strings that are UTF-8",
    Reason.DEPTH: "arrays and maps too deep inside one another",
    Reason.ENVELOPE: "the payload is no map, or a key of the envelope is missing or, `data` apart, of a wrong type",
    Reason.VERSION: "another protocol major",
    Reason.NOT_FINITE: "a NaN or an infinity where the body has a number",
    Reason.BODY: "`data` is no map, or not the body that its topic promises",
}


class ProtocolError(Exception):
    """Base of all errors of this package."""


class TopicError(ProtocolError):
    """The topic is malformed or names no known stream."""


class EncodeError(ProtocolError):
    """The message may not be sent."""


class DecodeError(ProtocolError):
    """The bytes are not a message of this protocol.

    Attributes: ``reason`` (what receivers count by), ``topic`` (as far as it could be read, else None).
    """

    def __init__(self, reason: Reason, detail: str, topic: str | None = None) -> None:
        # What came in may be quoted in it, and is of any length.
        detail = detail if len(detail) <= MAX_DETAIL else f"{detail[:MAX_DETAIL]}..."
        super().__init__(f"{reason}: {detail}" + (f" (topic {topic})" if topic else ""))
        self.reason = reason
        self.detail = detail
        self.topic = topic
