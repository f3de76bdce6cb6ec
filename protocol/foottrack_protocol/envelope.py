"""Envelope and codec: two frames ``[topic][msgpack map]`` to a Message and back.

``decode`` is total: any bytes give a Message or a DecodeError with a reason, nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgpack
from pydantic import ValidationError

from foottrack_protocol.errors import DecodeError, EncodeError, Reason, TopicError
from foottrack_protocol.messages import Body
from foottrack_protocol.topics import Topic, lookup, split_topic

PROTOCOL_MAJOR = 1
PROTOCOL_MINOR = 0
MAX_PAYLOAD_BYTES = 256 * 1024
MAX_TOPIC_BYTES = 128
MAX_DEPTH = 12
"""Containers inside containers, the envelope being the first."""

_INT64 = range(-(2**63), 2**63)
_NOT_FINITE_TYPES = frozenset({"finite_number"})


class Message(NamedTuple):
    """One message. Stamps are ns of the bus clock; ``data`` is the registry's body for the stream."""

    user: str
    stream: str
    src: str
    sid: str
    seq: int
    t: int
    t_pub: int
    valid: bool
    data: Any

    @property
    def topic(self) -> str:
        """``<user>/<stream>``."""
        return f"{self.user}/{self.stream}"


def encode(message: Message) -> tuple[bytes, bytes]:
    """The two frames of a message.

    Raises EncodeError when the receiver would refuse it for its size or a stamp out of range, TopicError for an unknown
    stream. The body is a model and was validated when it was made.
    """
    topic = f"{message.user}/{message.stream}"
    lookup(message.user, message.stream)
    try:
        payload: bytes = msgpack.packb(
            {
                "v": PROTOCOL_MAJOR,
                "src": message.src,
                "sid": message.sid,
                "seq": message.seq,
                "t": message.t,
                "t_pub": message.t_pub,
                "valid": message.valid,
                "data": message.data,
            },
            default=_fields,
        )
    except (TypeError, ValueError, OverflowError) as error:
        raise EncodeError(f"{topic}: {error}") from error
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise EncodeError(f"{topic}: {len(payload)} bytes, at most {MAX_PAYLOAD_BYTES}")
    return topic.encode(), payload


def decode(frames: Sequence[bytes]) -> Message:
    """The message in two frames. Raises DecodeError, and nothing else, for bytes that are none."""
    if len(frames) != 2:
        raise DecodeError(Reason.FRAMES, f"{len(frames)} frames, must be 2")
    raw_topic, payload = frames
    user, entry = _read_topic(raw_topic)
    topic = f"{user}/{entry.stream}"
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise DecodeError(Reason.OVERSIZED, f"{len(payload)} bytes, at most {MAX_PAYLOAD_BYTES}", topic)
    return read_envelope(_unpack(payload, topic), user, entry)


def read_envelope(envelope: dict[Any, Any], user: str, entry: Topic) -> Message:
    """The message of an unpacked envelope, as ``decode`` and importers of bare streams need it. Raises DecodeError."""
    topic = f"{user}/{entry.stream}"
    get = envelope.get
    version = get("v")
    if type(version) is not int:
        raise DecodeError(Reason.ENVELOPE, "v must be an int", topic)
    if version != PROTOCOL_MAJOR:
        raise DecodeError(Reason.VERSION, f"protocol {version}, this side speaks {PROTOCOL_MAJOR}", topic)
    src, sid, seq, t, t_pub, valid = get("src"), get("sid"), get("seq"), get("t"), get("t_pub"), get("valid")
    if type(src) is not str or type(sid) is not str:
        raise DecodeError(Reason.ENVELOPE, "src and sid must be strings", topic)
    if type(seq) is not int or seq < 0 or seq not in _INT64:
        raise DecodeError(Reason.ENVELOPE, "seq must be an int from 0", topic)
    if type(t) is not int or type(t_pub) is not int or t not in _INT64 or t_pub not in _INT64:
        raise DecodeError(Reason.ENVELOPE, "t and t_pub must be ints of 64 bits (ns)", topic)
    if type(valid) is not bool:
        raise DecodeError(Reason.ENVELOPE, "valid must be a bool", topic)
    if "data" not in envelope:
        raise DecodeError(Reason.ENVELOPE, "data is missing", topic)
    try:
        data = entry.adapter.validate_python(envelope["data"])
    except ValidationError as error:
        raise _body_error(error, topic) from None
    return Message(user, entry.stream, src, sid, seq, t, t_pub, valid, data)


def unpack_map(payload: bytes) -> dict[Any, Any]:
    """A msgpack map within the limits of size and depth, as the control socket needs it. Raises DecodeError."""
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise DecodeError(Reason.OVERSIZED, f"{len(payload)} bytes, at most {MAX_PAYLOAD_BYTES}")
    return _unpack(payload, None)


def pack_map(values: dict[str, Any]) -> bytes:
    """A msgpack map; models inside are written as maps. Raises EncodeError."""
    try:
        packed: bytes = msgpack.packb(values, default=_fields)
    except (TypeError, ValueError, OverflowError) as error:
        raise EncodeError(str(error)) from error
    return packed


def _fields(value: object) -> dict[str, Any]:
    if isinstance(value, Body):
        return value.__dict__
    raise TypeError(f"{type(value).__name__} has no place on the wire")


def _read_topic(raw: bytes) -> tuple[str, Topic]:
    if len(raw) > MAX_TOPIC_BYTES:
        raise DecodeError(Reason.TOPIC, f"topic of {len(raw)} bytes")
    try:
        return split_topic(raw.decode())
    except (UnicodeDecodeError, TopicError) as error:
        raise DecodeError(Reason.TOPIC, str(error)) from None


def _unpack(payload: bytes, topic: str | None) -> dict[Any, Any]:
    try:
        value = msgpack.unpackb(payload)
    except (msgpack.StackError, RecursionError):
        raise DecodeError(Reason.DEPTH, f"more than {MAX_DEPTH} levels", topic) from None
    except Exception as error:  # msgpack raises a dozen kinds; whatever it was, these bytes are no message
        raise DecodeError(Reason.MSGPACK, f"{type(error).__name__}: {error}"[:200], topic) from None
    if type(value) is not dict:
        raise DecodeError(Reason.ENVELOPE, f"a map is due, not {type(value).__name__}", topic)
    if _deeper_than(value, MAX_DEPTH):
        raise DecodeError(Reason.DEPTH, f"more than {MAX_DEPTH} levels", topic)
    return value


def _deeper_than(value: dict[Any, Any], limit: int) -> bool:
    level: list[Any] = [value]
    for _ in range(limit):
        below = [
            item
            for container in level
            for item in (container.values() if type(container) is dict else container)
            if type(item) is dict or type(item) is list
        ]
        if not below:
            return False
        level = below
    return True


def _body_error(error: ValidationError, topic: str) -> DecodeError:
    first = error.errors(include_url=False, include_context=False)[0]
    place = ".".join(str(part) for part in first["loc"]) or "data"
    given = first.get("input")
    not_finite = first["type"] in _NOT_FINITE_TYPES or (type(given) is float and not math.isfinite(given))
    reason = Reason.NOT_FINITE if not_finite else Reason.BODY
    return DecodeError(reason, f"{place}: {first['msg']}", topic)
