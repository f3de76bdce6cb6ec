"""Golden frames that must be refused, and why: one fault in each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import msgpack

from foottrack_protocol.envelope import MAX_DEPTH, MAX_PAYLOAD_BYTES, decode
from foottrack_protocol.errors import DecodeError, Reason
from foottrack_protocol.golden.bodies import BODIES, CALIBRATIONS, SYSTEM_BODIES
from foottrack_protocol.golden.packing import ENVELOPE, nested_arrays
from foottrack_protocol.golden.valid import changed, paths, without
from foottrack_protocol.values import MAX_ITEMS

_TOPIC = b"user/imu/left"
_IMU = BODIES["imu/left"]
_WHOLE = {**ENVELOPE, "data": _IMU}
_NAN, _INF = float("nan"), float("inf")


class Refused(NamedTuple):
    """Frames that are no message; ``zeros`` bytes 0 follow the last."""

    name: str
    frames: tuple[bytes, ...]
    reason: Reason
    zeros: int = 0

    @property
    def on_wire(self) -> tuple[bytes, ...]:
        """The frames with their zeros."""
        return (*self.frames[:-1], self.frames[-1] + bytes(self.zeros)) if self.zeros else self.frames


def refused() -> list[Refused]:
    """All of them."""
    return [*_frames(), *_topics(), *_bytes(), *_envelopes(), *_numbers(), *_bodies(), *_missing()]


def as_json(item: Refused) -> dict[str, Any]:
    """As it stands in ``vectors/``. Raises AssertionError when our own decoder disagrees."""
    try:
        decode(item.on_wire)
    except DecodeError as error:
        if error.reason is not item.reason:
            raise AssertionError(f"{item.name}: {error}, but should be {item.reason}") from error
    else:
        raise AssertionError(f"{item.name}: must be refused ({item.reason})")
    entry = {"name": item.name, "frames_hex": [frame.hex() for frame in item.frames], "reason": item.reason.value}
    return {**entry, "last_frame_zeros": item.zeros} if item.zeros else entry


def _pack(value: Any) -> bytes:
    packed: bytes = msgpack.packb(value)
    return packed


def _with(**keys: Any) -> bytes:
    return _pack({**_WHOLE, **keys})


def _body(stream: str, **keys: Any) -> tuple[bytes, bytes]:
    system = stream in SYSTEM_BODIES
    body = (SYSTEM_BODIES if system else BODIES)[stream]
    return f"{'sys' if system else 'user'}/{stream}".encode(), _pack({**ENVELOPE, "data": {**body, **keys}})


def _frames() -> Iterator[Refused]:
    yield Refused("no frame", (), Reason.FRAMES)
    yield Refused("one frame", (_TOPIC,), Reason.FRAMES)
    yield Refused("three frames", (_TOPIC, _pack(_WHOLE), b""), Reason.FRAMES)


def _topics() -> Iterator[Refused]:
    for name, topic in {
        "empty": b"",
        "without a slash": b"user",
        "without a stream": b"user/",
        "without a user": b"/imu/left",
        "unknown stream": b"user/imu/middle",
        "longer than a stream": b"user/imu/left/",
        "upper case": b"User/imu/left",
        "user begins with a hyphen": b"-user/imu/left",
        "user of 33 characters": b"a" * 33 + b"/imu/left",
        "user ends with a line feed": b"user\n/imu/left",
        "user's stream under sys": b"sys/imu/left",
        "the service's stream under a user": b"user/session",
        "welcome with two frames": b"sys/welcome",
        "not UTF-8": b"user/imu/left\xff",
        "200 bytes": b"a" * 200,
    }.items():
        yield Refused(f"topic: {name}", (topic, _pack(_WHOLE)), Reason.TOPIC)


def _bytes() -> Iterator[Refused]:
    whole = _pack(_WHOLE)
    later = _with(later=0)[:-1]
    too_large = MAX_PAYLOAD_BYTES + 1 - len(whole)
    yield Refused("one byte too large", (_TOPIC, whole), Reason.OVERSIZED, too_large)
    for name, payload in {
        "empty": b"",
        "cut in the middle": whole[: len(whole) // 2],
        "without its last byte": whole[:-1],
        "with a byte too many": whole + b"\xc0",
        "reserved byte c1": later + b"\xc1",
        "string that is not UTF-8": later + b"\xa1\xff",
        "integer as a key": b"\x81\x01\x02",
        "nil as a key": b"\x81\xc0\x02",
        "array that promises 2^32-1 elements": later + b"\xdd\xff\xff\xff\xff",
        "map that promises 2^32-1 elements": later + b"\xdf\xff\xff\xff\xff",
        "bytes that promise 2^32-1": later + b"\xc6\xff\xff\xff\xff",
        "array of too many elements": _with(later=[0] * (MAX_ITEMS + 1)),
        "map of too many elements": _with(later={str(i): 0 for i in range(MAX_ITEMS + 1)}),
    }.items():
        yield Refused(f"msgpack: {name}", (_TOPIC, payload), Reason.MSGPACK)
    yield Refused("one level too deep", (_TOPIC, later + nested_arrays(MAX_DEPTH)), Reason.DEPTH)
    yield Refused("500 levels", (_TOPIC, later + nested_arrays(500)), Reason.DEPTH)
    yield Refused("5000 levels", (_TOPIC, later + nested_arrays(5000)), Reason.DEPTH)
    deep_body = {**_IMU, "later": msgpack.unpackb(nested_arrays(MAX_DEPTH - 1))}
    yield Refused("one level too deep inside the body", (_TOPIC, _with(data=deep_body)), Reason.DEPTH)


def _envelopes() -> Iterator[Refused]:
    for name, value in {"an array": [1], "an integer": 1, "nil": None, "a string": "v"}.items():
        yield Refused(f"payload is {name}", (_TOPIC, _pack(value)), Reason.ENVELOPE)
    for key in _WHOLE:
        yield Refused(f"envelope: {key} absent", (_TOPIC, _pack(without(_WHOLE, (key,)))), Reason.ENVELOPE)
    for key in ENVELOPE:
        yield Refused(f"envelope: {key} nil", (_TOPIC, _with(**{key: None})), Reason.ENVELOPE)
    for name, key, wrong in (
        ("v is a string", "v", "1"),
        ("v is a float", "v", 1.0),
        ("v is a bool", "v", True),
        ("src is an integer", "src", 3),
        ("src is bytes", "src", b"golden"),
        ("sid is an integer", "sid", 3),
        ("seq is negative", "seq", -1),
        ("seq is a float", "seq", 7.0),
        ("seq is a bool", "seq", True),
        ("seq beyond 63 bits", "seq", 2**63),
        ("t is a float", "t", 1.5e9),
        ("t is NaN", "t", _NAN),
        ("t beyond 63 bits", "t", 2**63),
        ("t_pub is a string", "t_pub", "now"),
        ("t_pub beyond 63 bits", "t_pub", 2**64 - 1),
        ("valid is an integer", "valid", 1),
    ):
        yield Refused(f"envelope: {name}", (_TOPIC, _with(**{key: wrong})), Reason.ENVELOPE)
    for version in (0, 2, -1, 2**64 - 1):
        yield Refused(f"protocol {version}", (_TOPIC, _with(v=version)), Reason.VERSION)
    yield Refused("protocol 2 with a body we do not know", (_TOPIC, _with(v=2, data=[])), Reason.VERSION)


def _numbers() -> Iterator[Refused]:
    for name, number in {"NaN": _NAN, "infinity": _INF, "-infinity": -_INF}.items():
        for stream, keys in (
            ("imu/left", {"acc": [0.0, number, 0.0]}),
            ("imu/left", {"q": [0.0, 0.0, 0.0, number]}),
            ("imu/left", {"t_dev": number}),
            ("marker/left", {"cov": [1e-6, 0.0, 0.0, 1e-6, 0.0, number]}),
            ("marker/left", {"size_ratio": number}),
            ("gait/state", {"speed": number}),
            ("calibration", {"values": {"height": number}}),
        ):
            place = next(iter(keys))
            yield Refused(f"{name} in {stream} {place}", _body(stream, **keys), Reason.NOT_FINITE)
        yield Refused(f"{name} for an array", _body("imu/left", acc=number), Reason.BODY)
        yield Refused(f"{name} for a string", _body("gait/event", event=number), Reason.BODY)
        yield Refused(f"{name} for a body", (_TOPIC, _with(data=number)), Reason.BODY)
    hollow = _pack({**_WHOLE, "data": {**_IMU, "acc": []}})
    for name, raw in {
        "NaN of 32 bits": b"\xca\x7f\xc0\x00\x00",
        "infinity of 32 bits": b"\xca\x7f\x80\x00\x00",
        "signalling NaN": b"\xcb\x7f\xf0\x00\x00\x00\x00\x00\x01",
    }.items():
        payload = hollow.replace(b"\xa3acc\x90", b"\xa3acc\x93\x00\x00" + raw)
        yield Refused(name, (_TOPIC, payload), Reason.NOT_FINITE)


def _bodies() -> Iterator[Refused]:
    others: tuple[Any, ...] = (None, [], 1, "acc", b"acc", True)
    for other in others:
        yield Refused(f"data is {other!r}", (_TOPIC, _pack({**ENVELOPE, "data": other})), Reason.BODY)
    pose = BODIES["pose/body"]
    for name, stream, keys in _WRONG_BODIES:
        yield Refused(f"{stream}: {name}", _body(stream, **keys), Reason.BODY)
    for name, path, wrong in (
        ("a foot without an ankle", ("left", "ankle"), None),
        ("an ankle without rotation", ("left", "ankle", "q"), None),
        ("unknown stage", ("left", "stage"), "guessed"),
        ("negative sigma", ("left", "sigma"), -0.001),
        ("contact is an integer", ("left", "contact"), 1),
    ):
        data = changed(pose, path, wrong)
        yield Refused(f"pose/body: {name}", (b"user/pose/body", _pack({**ENVELOPE, "data": data})), Reason.BODY)


_WRONG_BODIES: tuple[tuple[str, str, dict[Any, Any]], ...] = (
    ("two numbers for three", "imu/left", {"acc": [0.0, 9.75]}),
    ("four numbers for three", "imu/left", {"acc": [0.0, 9.75, 0.0, 0.0]}),
    ("a map for an array", "imu/left", {"acc": {"x": 0.0, "y": 9.75, "z": 0.0}}),
    ("a string of three characters for an array", "imu/left", {"acc": "123"}),
    ("bytes for an array", "imu/left", {"acc": b"123"}),
    ("a string for a number", "imu/left", {"acc": ["0", 9.75, 0.0]}),
    ("a bool for a number", "imu/left", {"acc": [True, 9.75, 0.0]}),
    ("nil for a number", "imu/left", {"acc": [None, 9.75, 0.0]}),
    ("neither gyro nor q", "imu/left", {"gyro": None, "q": None}),
    ("a float for an integer", "imu/left", {"t_arr": 1.0}),
    ("a bool for an integer", "imu/left", {"t_dev": True}),
    ("an integer beyond 63 bits", "imu/left", {"t_dev": 2**63}),
    ("accuracy 4", "imu/left", {"accuracy": 4}),
    ("a quaternion that is too long", "imu/left", {"q": [0.0, 0.0, 0.0, 1.0015]}),
    ("a quaternion that is too short", "imu/left", {"q": [0.0, 0.0, 0.0, 0.9985]}),
    ("a quaternion of zeros", "imu/left", {"q": [0.0, 0.0, 0.0, 0.0]}),
    ("a quaternion of three", "imu/left", {"q": [0.0, 0.0, 1.0]}),
    ("a quaternion whose square overflows", "imu/left", {"q": [1e200, 0.0, 0.0, 1e200]}),
    ("a covariance with a negative variance", "marker/left", {"cov": [1e-6, 0.0, 0.0, -1e-6, 0.0, 1e-6]}),
    ("a covariance that is not semidefinite", "marker/left", {"cov": [1e-6, 2e-6, 0.0, 1e-6, 0.0, 1e-6]}),
    ("a covariance that is none by its determinant", "marker/left", {"cov": [1.0, 0.9, -0.9, 1.0, 0.9, 1.0]}),
    ("a covariance whose products overflow", "marker/left", {"cov": [1e200, 0.0, 1e250, 1e200, 0.0, 1e200]}),
    ("a covariance of nine", "marker/left", {"cov": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}),
    ("negative size ratio", "marker/left", {"size_ratio": -1.0}),
    ("tracked without position", "head/pose", {"p": None}),
    ("tracked without rotation", "head/pose", {"q": None}),
    ("tracked is an integer", "head/pose", {"tracked": 1}),
    ("moved without rotation", "head/pose", {"moved": {"p": [0.0, 0.0, 0.0]}}),
    ("unknown kind", "calibration", {"kind": "shoe"}),
    ("values of another kind", "calibration", {"kind": "body"}),
    ("jpeg as a string", "camera/preview", {"jpeg": "abc"}),
    ("unknown mode", "pose/ik", {"mode": "run"}),
    ("pelvis above its standing height", "pose/ik", {"pelvis_dy": 0.01}),
    ("heading that is no direction", "pose/ik", {"heading": [0.0, 0.0, 0.0]}),
    ("unknown phase", "gait/state", {"left": {"phase": "flight", "height": 0.0, "vy": 0.0}}),
    ("negative number of steps", "gait/state", {"steps": -1}),
    ("unknown event", "gait/event", {"event": "jump"}),
    ("unknown side", "gait/event", {"side": "middle"}),
    ("a foot's event without a side", "gait/event", {"side": None}),
    ("user with a capital", "session", {"users": ["User"]}),
    ("user with a line feed", "session", {"users": ["user\n"]}),
    ("users that are no strings", "session", {"users": [b"user"]}),
    ("a counter that is a float", "health", {"drops": {"topic": 1.0}}),
    ("a counter under a key that is bytes", "health", {"drops": {b"topic": 1}}),
    ("unknown level", "log", {"level": "info"}),
)


def _missing() -> Iterator[Refused]:
    """Every key that may be neither nil nor absent."""
    cases: list[tuple[str, dict[str, Any]]] = [
        *((f"user/{stream}", body) for stream, body in BODIES.items() if not stream.endswith("/right")),
        *(("user/calibration", body) for body in CALIBRATIONS),
        *((f"sys/{stream}", body) for stream, body in SYSTEM_BODIES.items()),
    ]
    for topic, body in cases:
        for path in paths(body):
            place = ".".join(path)
            for what, data in (("nil", changed(body, path, None)), ("absent", without(body, path))):
                frames = (topic.encode(), _pack({**ENVELOPE, "data": data}))
                try:
                    decode(frames)
                except DecodeError:
                    kind = f" ({body['kind']})" if "kind" in body else ""
                    yield Refused(f"{topic}{kind}: {place} {what}", frames, Reason.BODY)
