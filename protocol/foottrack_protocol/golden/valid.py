"""Golden messages that must be taken: every stream, every key that may be nil or absent, every liberty of a sender."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import msgpack

from foottrack_protocol.envelope import MAX_DEPTH, MAX_PAYLOAD_BYTES, PROTOCOL_MAJOR, Message, decode, encode
from foottrack_protocol.errors import DecodeError
from foottrack_protocol.golden.bodies import BODIES, CALIBRATIONS, PAIR_EVENT, SYSTEM_BODIES
from foottrack_protocol.golden.packing import ENVELOPE, nested_arrays, widest
from foottrack_protocol.topics import SYSTEM_TOPICS, TOPICS
from foottrack_protocol.values import INT64_MAX, INT64_MIN


class Golden(NamedTuple):
    """A message's bytes; ``zeros`` bytes 0 follow its payload."""

    name: str
    topic: str
    payload: bytes
    zeros: int = 0

    @property
    def frames(self) -> tuple[bytes, bytes]:
        """As they are on the wire."""
        return self.topic.encode(), self.payload + bytes(self.zeros)


def by_body() -> dict[str, list[Golden]]:
    """Golden messages by the name of their body's schema."""
    found: dict[str, list[Golden]] = {}
    for stream, entry in TOPICS.items():
        variants = not stream.endswith("/right")
        found.setdefault(entry.schema, []).extend(_of_stream(f"user/{stream}", BODIES[stream], variants))
    for body in CALIBRATIONS:
        found["calibration"].extend(_of_stream("user/calibration", body, True))
    found["gait_event"].extend(_of_stream("user/gait/event", PAIR_EVENT, True))
    for stream, entry in SYSTEM_TOPICS.items():
        found[entry.schema] = list(_of_stream(f"sys/{stream}", SYSTEM_BODIES[stream], True))
    return found


def of_envelope() -> list[Golden]:
    """Golden messages about the envelope and the encoding, whatever the body."""
    topic, body = "user/imu/left", BODIES["imu/left"]
    head, pose, marker = BODIES["head/pose"], BODIES["pose/body"], BODIES["marker/left"]
    everything = {
        "nil": None,
        "bool": False,
        "int": INT64_MIN,
        "uint": 2**64 - 1,
        "float": 0.5,
        "nan": float("nan"),
        "str": "ü",
        "bin": b"\x00\xff",
        "ext": msgpack.ExtType(42, b"\x01\x02\x03"),
        "array": [1, [2.0, {}]],
        "map": {"a": {"b": []}},
    }
    full = {**ENVELOPE, "data": body}
    bytes_key: dict[Any, Any] = {**full, b"v": 2}
    later = msgpack.packb({**full, "later": 0})[:-1]
    large = msgpack.packb({**full, "later": b""})[:-2]
    room = MAX_PAYLOAD_BYTES - len(large) - 5
    singles = msgpack.packb({**full, "data": pose}, use_single_float=True)
    return [
        *(Golden(name, topic, msgpack.packb({**full, **changed})) for name, changed in _ENVELOPES.items()),
        Golden("the longest user", f"{'a' * 32}/imu/left", msgpack.packb(full)),
        Golden("a user of digits and hyphens", "0--9/imu/left", msgpack.packb(full)),
        Golden("unknown keys of every type in the envelope", topic, msgpack.packb({**everything, **full})),
        Golden("unknown keys of every type in the body", topic, _packed({**body, **everything})),
        Golden(
            "unknown keys in a nested map",
            "user/head/pose",
            _packed({**head, "moved": {**head["moved"], **everything}}),
        ),
        Golden("an extension of a type that msgpack keeps for itself", topic, later + b"\xd4\x80\x00"),
        Golden("a key that is bytes", topic, msgpack.packb(bytes_key)),
        Golden("keys in reverse order", topic, msgpack.packb(dict(reversed(full.items())))),
        Golden("as deep as may be", topic, later + nested_arrays(MAX_DEPTH - 1)),
        Golden("as large as may be", topic, large + b"\xc6" + room.to_bytes(4, "big"), room),
        Golden("every value in its longest form", topic, widest(full)),
        Golden("every value in its longest form, nested", "user/pose/body", widest({**ENVELOPE, "data": pose})),
        Golden("floats of 32 bits", "user/pose/body", singles),
        Golden("a quaternion that is a little long", topic, _packed({**body, "q": [0.0, 0.0, 0.0, 1.0009765625]})),
        Golden("a quaternion that is a little short", topic, _packed({**body, "q": [0.0, 0.599609375, 0.0, -0.8]})),
        Golden("negative zero", topic, _packed({**body, "acc": [-0.0, 0.0, -0.0]})),
        Golden(
            "the largest and the smallest floats",
            topic,
            _packed({**body, "acc": [1.7976931348623157e308, -1.7976931348623157e308, 5e-324]}),
        ),
        Golden("the largest device counter", topic, _packed({**body, "t_dev": INT64_MAX})),
        Golden("a negative device counter", topic, _packed({**body, "t_dev": -1})),
        Golden("a float as a large integer", topic, _packed({**body, "acc": [2**64 - 1, -(2**63), 65536]})),
        Golden("a covariance of rank 1", "user/marker/left", _packed({**marker, "cov": [4, 2, 0, 1, 0, 0]})),
        Golden("a covariance of zeros", "user/marker/left", _packed({**marker, "cov": [0, 0, 0, 0, 0, 0]})),
        Golden("a head that is not tracked", "user/head/pose", _packed({"tracked": False})),
        Golden(
            "a head that is not tracked, with nil", "user/head/pose", _packed({"p": None, "q": None, "tracked": False})
        ),
    ]


def as_json(golden: Golden) -> dict[str, Any]:
    """A golden message as it stands in ``vectors/``: its bytes, and what a receiver makes of them."""
    message = decode(golden.frames)
    try:
        canonical = encode(message) == golden.frames
    except Exception as error:
        raise AssertionError(f"{golden.name}: decoded, but cannot be sent again") from error
    entry = {
        "name": golden.name,
        "topic": golden.topic,
        "topic_hex": golden.topic.encode().hex(),
        "payload_hex": golden.payload.hex(),
        "canonical": canonical,
        "message": message_as_json(message),
    }
    return {**entry, "payload_zeros": golden.zeros} if golden.zeros else entry


def message_as_json(message: Message) -> dict[str, Any]:
    """Envelope and body of a decoded message; bytes as base64."""
    envelope = {key: getattr(message, key) for key in ENVELOPE if key != "v"}
    return {"v": PROTOCOL_MAJOR, **envelope, "data": message.data.model_dump(mode="json")}


_ENVELOPES: dict[str, dict[str, Any]] = {
    "stamps before zero": {"t": -1, "t_pub": -(2**40)},
    "the largest stamps": {"t": INT64_MAX, "t_pub": INT64_MAX},
    "the smallest stamps": {"t": INT64_MIN, "t_pub": INT64_MIN},
    "the largest seq": {"seq": INT64_MAX},
    "the first seq": {"seq": 0},
    "not valid": {"valid": False},
    "names beyond ASCII": {"src": "頭-ü", "sid": "👣"},
    "empty names": {"src": "", "sid": ""},
}


def _packed(body: dict[str, Any]) -> bytes:
    payload: bytes = msgpack.packb({**ENVELOPE, "data": body})
    return payload


def _of_stream(topic: str, body: dict[str, Any], variants: bool) -> Iterator[Golden]:
    kind = next((f" ({body[key]})" for key in ("kind", "event") if key in body), "")
    yield Golden(f"{topic}{kind}", topic, _packed(body))
    if not variants:
        return
    whole = _whole(body)
    if whole != body:
        yield Golden(f"{topic}{kind}: whole numbers as integers", topic, _packed(whole))
    for path in paths(body):
        name = ".".join(path)
        nil, absent = _packed(changed(body, path, None)), _packed(without(body, path))
        for what, payload in (("nil", nil), ("absent", absent)):
            golden = Golden(f"{topic}{kind}: {name} {what}", topic, payload)
            if _is_taken(golden):
                yield golden


def _is_taken(golden: Golden) -> bool:
    try:
        decode(golden.frames)
    except DecodeError:
        return False
    return True


def paths(body: dict[str, Any], prefix: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """All keys of a body, nested ones too; of two sides with the same keys only the left one's."""
    for key, value in body.items():
        yield (*prefix, key)
        if isinstance(value, dict) and not (key == "right" and "left" in body):
            yield from paths(value, (*prefix, key))


def changed(body: dict[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    """The body with another value in one place."""
    first, *rest = path
    return {**body, first: changed(body[first], tuple(rest), value) if rest else value}


def without(body: dict[str, Any], path: tuple[str, ...]) -> dict[str, Any]:
    """The body without one of its keys."""
    first, *rest = path
    if rest:
        return {**body, first: without(body[first], tuple(rest))}
    return {key: value for key, value in body.items() if key != first}


def _whole(value: Any, key: str = "") -> Any:
    if key in ("q", "q_alt") and value is not None:
        return [0, 0, 0, 1]
    if key == "heading" and isinstance(value, list):
        return [0, 0, -1]
    if key == "cov":
        return [1, 0, 0, 1, 0, 1]
    if isinstance(value, float):
        return round(value)
    if isinstance(value, list):
        return [_whole(item) for item in value]
    if isinstance(value, dict):
        return {name: _whole(item, name) for name, item in value.items()}
    return value
