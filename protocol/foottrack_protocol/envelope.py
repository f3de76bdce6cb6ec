"""Envelope and codec: two frames ``[topic][msgpack map]`` to a Message and back.

``decode`` is total: any bytes give a Message or a DecodeError with a reason, nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import msgpack
from pydantic import ValidationError

from foottrack_protocol.errors import DecodeError, EncodeError, Reason, TopicError
from foottrack_protocol.topics import Topic, lookup, split_topic
from foottrack_protocol.values import INT64_MAX, INT64_MIN, MAX_ITEMS, Body

PROTOCOL_MAJOR = 1
PROTOCOL_MINOR = 0
MAX_PAYLOAD_BYTES = 256 * 1024
MAX_TOPIC_BYTES = 128
MAX_DEPTH = 12
"""Containers inside containers, the envelope being the first."""

_KEYS = 8
"""Of the envelope, as far as this version knows them."""
_EXTENSION = object()
_NUMBER_FAULTS = {"finite_number", "int_type"}
"""Pydantic's names for a NaN where a float or an integer is due."""
_TOO_DEEP = f"more than {MAX_DEPTH} levels"


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
    """The two frames of a message. What a receiver would refuse is refused here.

    Raises TopicError for an unknown stream, EncodeError for anything else that is wrong: an envelope's value of the
    wrong type (numpy's integers and booleans are wrong ones), a body of another stream, a payload that is too large.
    The body's own values were validated when it was made.
    """
    user, stream, src, sid, seq, t, t_pub, valid, data = message
    try:
        entry, topic = _entry_and_frame(user, stream)
    except TypeError:
        raise TopicError("user and stream must be strings") from None
    fault = _fault(src, sid, seq, t, t_pub, valid)
    if fault is not None:
        raise EncodeError(f"{message.topic}: {fault}")
    if not isinstance(data, entry.models):
        due = " or ".join(model.__name__ for model in entry.models)
        raise EncodeError(f"{message.topic}: data must be {due}, not {type(data).__name__}")
    try:
        payload: bytes = msgpack.packb(
            {
                "v": PROTOCOL_MAJOR,
                "src": src,
                "sid": sid,
                "seq": seq,
                "t": t,
                "t_pub": t_pub,
                "valid": valid,
                "data": data.__dict__,
            },
            default=_fields,
        )
    except (TypeError, ValueError, OverflowError) as error:
        raise EncodeError(f"{message.topic}: {error}") from error
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise EncodeError(f"{message.topic}: {_too_large(payload)}")
    return topic, payload


def decode(frames: Sequence[bytes]) -> Message:
    """The message in two frames. Raises DecodeError, and nothing else, for bytes that are none."""
    if len(frames) != 2:
        raise DecodeError(Reason.FRAMES, f"{len(frames)} frames, must be 2")
    user, entry, topic = _read_topic(frames[0])
    return read_envelope(_unpack(frames[1], topic), user, entry)


def read_envelope(envelope: dict[Any, Any], user: str, entry: Topic) -> Message:
    """The message of an unpacked envelope, as ``decode`` and importers of bare streams need it. Raises DecodeError."""
    get: Callable[[str], Any] = envelope.get
    version = get("v")
    if version != PROTOCOL_MAJOR or type(version) is not int:
        raise _version_error(version, f"{user}/{entry.stream}")
    src, sid, seq, t, t_pub, valid = get("src"), get("sid"), get("seq"), get("t"), get("t_pub"), get("valid")
    fault = _fault(src, sid, seq, t, t_pub, valid)
    if fault is not None:
        raise DecodeError(Reason.ENVELOPE, fault, f"{user}/{entry.stream}")
    if "data" not in envelope:
        raise DecodeError(Reason.ENVELOPE, "data is missing", f"{user}/{entry.stream}")
    if len(envelope) == _KEYS:
        try:
            # Nothing that the models know is deep, so the depth is only measured where they meet unknown keys.
            data = entry.adapter.validator.validate_python(envelope["data"], extra="forbid")
        except ValidationError:
            data = _read_body_among_unknown_keys(envelope, user, entry)
    else:
        data = _read_body_among_unknown_keys(envelope, user, entry)
    return Message(user, entry.stream, src, sid, seq, t, t_pub, valid, data)


def unpack_map(payload: bytes) -> dict[Any, Any]:
    """A msgpack map within the limits of the wire, as the control socket needs it. Raises DecodeError."""
    values = _unpack(payload, None)
    if _deeper_than(values, MAX_DEPTH):
        raise DecodeError(Reason.DEPTH, _TOO_DEEP)
    return values


def pack_map(values: dict[str, Any]) -> bytes:
    """A msgpack map that ``unpack_map`` takes; models inside are written as maps. Raises EncodeError."""
    try:
        packed: bytes = msgpack.packb(values, default=_fields)
        unpack_map(packed)
    except (TypeError, ValueError, OverflowError, DecodeError) as error:
        raise EncodeError(str(error)) from error
    return packed


def _fields(value: object) -> dict[str, Any]:
    if isinstance(value, Body):
        return value.__dict__
    raise TypeError(f"{type(value).__name__} has no place on the wire")


@lru_cache(maxsize=1024)
def _entry_and_frame(user: str, stream: str) -> tuple[Topic, bytes]:
    return lookup(user, stream), f"{user}/{stream}".encode()


@lru_cache(maxsize=1024)
def _read_topic(raw: bytes) -> tuple[str, Topic, str]:
    if len(raw) > MAX_TOPIC_BYTES:
        raise DecodeError(Reason.TOPIC, f"topic of {len(raw)} bytes")
    try:
        topic = raw.decode()
        return *split_topic(topic), topic
    except (UnicodeDecodeError, TopicError) as error:
        raise DecodeError(Reason.TOPIC, str(error)) from None


def _fault(src: object, sid: object, seq: object, t: object, t_pub: object, valid: object) -> str | None:
    """What is wrong with an envelope's values."""
    if not (isinstance(src, str) and isinstance(sid, str)):
        return "src and sid must be strings"
    if type(seq) is not int or not 0 <= seq <= INT64_MAX:
        return "seq must be an int from 0"
    if type(t) is not int or type(t_pub) is not int:
        return "t and t_pub must be ints (ns)"
    if not (INT64_MIN <= t <= INT64_MAX and INT64_MIN <= t_pub <= INT64_MAX):
        return "t and t_pub must fit into 64 bits"
    if type(valid) is not bool:
        return "valid must be a bool"
    return None


def _unpack(payload: bytes, topic: str | None) -> dict[Any, Any]:
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise DecodeError(Reason.OVERSIZED, _too_large(payload), topic)
    try:
        value = msgpack.unpackb(payload, max_array_len=MAX_ITEMS, max_map_len=MAX_ITEMS, ext_hook=_extension)
    except (msgpack.StackError, RecursionError):
        raise DecodeError(Reason.DEPTH, _TOO_DEEP, topic) from None
    except Exception as error:  # msgpack raises a dozen kinds; whatever it was, these bytes are no message
        raise DecodeError(Reason.MSGPACK, f"{type(error).__name__}: {error}", topic) from None
    if type(value) is not dict:
        raise DecodeError(Reason.ENVELOPE, f"a map is due, not {type(value).__name__}", topic)
    return value


def _extension(_code: int, _data: bytes) -> object:
    """Means nothing on this wire. Msgpack's own ExtType refuses the codes below 0."""
    return _EXTENSION


def _read_body_among_unknown_keys(envelope: dict[Any, Any], user: str, entry: Topic) -> Any:
    topic = f"{user}/{entry.stream}"
    if _deeper_than(envelope, MAX_DEPTH):
        raise DecodeError(Reason.DEPTH, _TOO_DEEP, topic)
    try:
        return entry.adapter.validator.validate_python(envelope["data"])
    except ValidationError as error:
        raise _body_error(error, topic) from None


def _deeper_than(value: dict[Any, Any], limit: int) -> bool:
    level: list[Any] = [value]
    for _ in range(limit):
        level = [
            item
            for container in level
            for item in (container.values() if type(container) is dict else container)
            if type(item) is dict or type(item) is list
        ]
        if not level:
            return False
    return True


def _too_large(payload: bytes) -> str:
    return f"{len(payload)} bytes, at most {MAX_PAYLOAD_BYTES}"


def _version_error(version: object, topic: str) -> DecodeError:
    if type(version) is not int:
        return DecodeError(Reason.ENVELOPE, "v must be an int", topic)
    return DecodeError(Reason.VERSION, f"protocol {version}, this side speaks {PROTOCOL_MAJOR}", topic)


def _body_error(error: ValidationError, topic: str) -> DecodeError:
    first = error.errors(include_url=False, include_context=False)[0]
    place = ".".join(str(part) for part in first["loc"]) or "data"
    given = first["input"]
    not_finite = type(given) is float and not math.isfinite(given) and first["type"] in _NUMBER_FAULTS
    return DecodeError(Reason.NOT_FINITE if not_finite else Reason.BODY, f"{place}: {first['msg']}", topic)
