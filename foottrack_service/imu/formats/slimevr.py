"""Packets between a SlimeVR firmware tracker and its server, over UDP; all numbers are big-endian.

A tracker's packet is type (uint32), number (uint64), body; in a bundle the inner ones have a length and no number. The
tracker's axes are the chip's (z up, y forward), acceleration is linear. Source: SlimeVR-Tracker-ESP ``src/network``
(protocol 22) and SlimeVR-Server ``trackers/udp``.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import NamedTuple

from foottrack_service.imu.sample import Quat, Vec3, unit_quaternion

DEFAULT_PORT = 6969
MAX_LINEAR = 1000.0
"""m/s^2."""
QUATERNION_SLACK = 0.05


class Kind(IntEnum):
    """Packet types that this project reads or writes."""

    HEARTBEAT = 0
    SERVER_HEARTBEAT = 1
    HANDSHAKE = 3
    ACCELERATION = 4
    PING = 10
    SENSOR_INFO = 15
    ROTATION = 17
    FEATURES = 22
    ROTATION_AND_ACCELERATION = 23
    BUNDLE = 100
    COMPACT_BUNDLE = 101


class Handshake(NamedTuple):
    """A tracker asks for its server. ``mac`` as ``AA:BB:CC:DD:EE:FF``, empty where it has none."""

    protocol: int
    firmware: str
    mac: str


class Rotation(NamedTuple):
    """Sensor to a z-up world."""

    sensor: int
    q: Quat
    accuracy: int | None


class Acceleration(NamedTuple):
    """Linear, m/s^2, sensor axes."""

    sensor: int
    linear: Vec3


class Ping(NamedTuple):
    """An echoed ping."""

    number: int


class SensorInfo(NamedTuple):
    """A sensor's state: 0 offline, 1 well, 2 error."""

    sensor: int
    state: int


class Features(NamedTuple):
    """A tracker asks what the server can do."""


class Heartbeat(NamedTuple):
    """The tracker lives."""


Packet = Handshake | Rotation | Acceleration | Ping | SensorInfo | Features | Heartbeat


class Datagram(NamedTuple):
    """One UDP datagram: its number and what was in it."""

    number: int
    packets: list[Packet]


_HEAD = struct.Struct(">IQ")
_ROTATION = struct.Struct(">BB4fB")
_ACCELERATION = struct.Struct(">3f")
_PACKED = struct.Struct(">B7h")
_CURRENT_ROTATION = 1


def decode(datagram: bytes, drops: Counter[str]) -> Datagram | None:
    """What a tracker sent. Drops: ``short``, ``quaternion``, ``range``; packets of other types are passed over."""
    if len(datagram) < _HEAD.size:
        drops["short"] += 1
        return None
    kind, number = _HEAD.unpack_from(datagram)
    body = datagram[_HEAD.size :]
    packets: list[Packet] = []
    for inner, inner_body in _unbundled(kind, body, drops):
        reader = _READERS.get(inner)
        if reader is None:
            continue
        try:
            packets += reader(inner_body, drops)
        except (struct.error, IndexError):
            drops["short"] += 1
    return Datagram(number, packets)


def handshake_reply() -> bytes:
    """The server's answer; the only packet whose type is its first byte."""
    return (b"\x03Hey OVR =D 5").ljust(64, b"\0")


def server_heartbeat() -> bytes:
    """Keeps the tracker connected: it gives up after 3 s of silence."""
    return _HEAD.pack(Kind.SERVER_HEARTBEAT, 0)


def ping(number: int) -> bytes:
    """The tracker sends it back as it is."""
    return _HEAD.pack(Kind.PING, 0) + struct.pack(">I", number)


def sensor_info_reply(info: SensorInfo) -> bytes:
    """Without it the tracker repeats its sensor info each second."""
    return struct.pack(">IBB", Kind.SENSOR_INFO, info.sensor, info.state)


def features_reply() -> bytes:
    """This server understands both kinds of bundle."""
    return _HEAD.pack(Kind.FEATURES, 0) + b"\x03"


def encode_handshake(handshake: Handshake) -> bytes:
    """As a tracker of protocol 22 sends it, for a simulated one. Its number is always 0."""
    firmware = handshake.firmware.encode()
    mac = bytes.fromhex(handshake.mac.replace(":", ""))
    numbers = struct.pack(">7I", 0, 0, 0, 0, 0, 0, handshake.protocol)
    return _HEAD.pack(Kind.HANDSHAKE, 0) + numbers + bytes([len(firmware)]) + firmware + mac + bytes(6)


def encode_rotation(number: int, rotation: Rotation) -> bytes:
    """For a simulated tracker."""
    body = _ROTATION.pack(rotation.sensor, _CURRENT_ROTATION, *rotation.q, rotation.accuracy or 0)
    return _HEAD.pack(Kind.ROTATION, number) + body


def encode_acceleration(number: int, acceleration: Acceleration) -> bytes:
    """For a simulated tracker."""
    body = _ACCELERATION.pack(*acceleration.linear) + bytes([acceleration.sensor])
    return _HEAD.pack(Kind.ACCELERATION, number) + body


def encode_bundle(number: int, packets: list[bytes]) -> bytes:
    """Packets of the functions above in one datagram, for a simulated tracker."""
    inner = (packet[:4] + packet[_HEAD.size :] for packet in packets)
    return _HEAD.pack(Kind.BUNDLE, number) + b"".join(struct.pack(">H", len(packet)) + packet for packet in inner)


def _unbundled(kind: int, body: bytes, drops: Counter[str]) -> Iterator[tuple[int, bytes]]:
    if kind not in (Kind.BUNDLE, Kind.COMPACT_BUNDLE):
        yield kind, body
        return
    head = struct.Struct(">HI" if kind == Kind.BUNDLE else ">BB")
    type_size = 4 if kind == Kind.BUNDLE else 1
    at = 0
    while at < len(body):
        if len(body) - at < head.size:
            drops["short"] += 1
            return
        length, inner = head.unpack_from(body, at)
        start = at + head.size
        at = start - type_size + length
        if length < type_size or at > len(body):
            drops["short"] += 1
            return
        yield inner, body[start:at]


def _handshake(body: bytes, drops: Counter[str]) -> list[Packet]:
    protocol = struct.unpack_from(">I", body, 24)[0] if len(body) >= 28 else 0
    text, mac = "", ""
    if len(body) > 28:
        end = 29 + body[28]
        text = body[29:end].rstrip(b"\0").decode("ascii", "replace")
        address = body[end : end + 6]
        if len(address) == 6 and any(address):
            mac = ":".join(f"{byte:02X}" for byte in address)
    return [Handshake(protocol, text, mac)]


def _rotation(body: bytes, drops: Counter[str]) -> list[Packet]:
    sensor, which, x, y, z, w, accuracy = _ROTATION.unpack_from(body)
    if which != _CURRENT_ROTATION:
        return []
    return _checked_rotation(sensor, (x, y, z, w), min(accuracy, 3), drops)


def _acceleration(body: bytes, drops: Counter[str]) -> list[Packet]:
    # Phones with owoTrack leave the sensor out.
    sensor = body[_ACCELERATION.size] if len(body) > _ACCELERATION.size else 0
    return _checked_acceleration(sensor, _ACCELERATION.unpack_from(body), drops)


def _packed(body: bytes, drops: Counter[str]) -> list[Packet]:
    sensor, x, y, z, w, ax, ay, az = _PACKED.unpack_from(body)
    rotation = _checked_rotation(sensor, (x / 32768, y / 32768, z / 32768, w / 32768), None, drops)
    return rotation + _checked_acceleration(sensor, (ax / 128, ay / 128, az / 128), drops)


def _checked_rotation(sensor: int, q: Quat, accuracy: int | None, drops: Counter[str]) -> list[Packet]:
    unit = unit_quaternion(*q, QUATERNION_SLACK)
    if unit is None:
        drops["quaternion"] += 1
        return []
    return [Rotation(sensor, unit, accuracy)]


def _checked_acceleration(sensor: int, linear: tuple[float, ...], drops: Counter[str]) -> list[Packet]:
    x, y, z = linear
    if not math.hypot(x, y, z) <= MAX_LINEAR:
        drops["range"] += 1
        return []
    return [Acceleration(sensor, (x, y, z))]


_READERS: dict[int, Callable[[bytes, Counter[str]], list[Packet]]] = {
    Kind.HEARTBEAT: lambda body, drops: [Heartbeat()],
    Kind.HANDSHAKE: _handshake,
    Kind.ROTATION: _rotation,
    Kind.ACCELERATION: _acceleration,
    Kind.PING: lambda body, drops: [Ping(struct.unpack_from(">I", body)[0])],
    Kind.SENSOR_INFO: lambda body, drops: [SensorInfo(body[0], body[1])],
    Kind.FEATURES: lambda body, drops: [Features()],
    Kind.ROTATION_AND_ACCELERATION: _packed,
}
