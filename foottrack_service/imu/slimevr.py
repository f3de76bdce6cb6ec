"""The server's side of SlimeVR trackers: datagrams in, samples and answers out, no socket and no clock."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from foottrack_service.imu.formats import slimevr
from foottrack_service.imu.formats.slimevr import Acceleration, Handshake, Ping, Rotation, SensorInfo
from foottrack_service.imu.sample import DeviceSample, Vec3, with_gravity

Address = tuple[str, int]

BEAT_S = 0.5
GONE_S = 3.0
"""A tracker that said nothing for so long has to shake hands again."""

PINGS_KEPT = 20
"""The least round trip of the last 10 s is what the way takes; the others waited for a radio that slept."""

MAX_TRACKERS = 32
"""Anybody on the network can shake hands: memory has an end."""

CONSISTENT_PROTOCOL = 22
"""Until then acceleration came in the chip's own axes while rotation was turned by the board's mounting."""

BOARD_TURN_RAD = -math.pi / 2.0
"""About the chip's z: the mounting of the official boards."""


class TrackerSample(NamedTuple):
    """A sample and the tracker's name: its MAC address (else its IP address), a slash, the sensor's number."""

    name: str
    sample: DeviceSample


class Answer(NamedTuple):
    """A datagram to send."""

    address: Address
    data: bytes


@dataclass
class _Tracker:
    name: str
    protocol: int
    heard_s: float
    handshake: bytes
    number: int = 0
    ping: int = 0
    ping_sent_s: float = 0.0
    round_trips_s: deque[float] = field(default_factory=lambda: deque(maxlen=PINGS_KEPT))
    rotations: dict[int, Rotation] = field(default_factory=dict)


class SlimeVrServer:
    """Any number of trackers. ``acc_turn`` says by how much, rad, the accelerations of a sensor (its name as in
    ``TrackerSample``) are turned about the chip's z, where a firmware's axes of rotation and acceleration differ; None
    does what the tracker's protocol version calls for.

    A sample is complete with its acceleration, which follows its rotation. Drops: those of ``decode``, ``stranger`` (no
    handshake), ``late`` (overtaken on the way), ``unpaired``, ``crowded``.
    """

    def __init__(self, acc_turn: Callable[[str], float | None] = lambda name: None) -> None:
        self.drops: Counter[str] = Counter()
        self._acc_turn = acc_turn
        self._trackers: dict[Address, _Tracker] = {}
        self._beat_due_s: float | None = None

    def receive(self, datagram: bytes, address: Address, now_s: float) -> tuple[list[TrackerSample], list[Answer]]:
        """One datagram: the samples in it, and what to answer."""
        content = slimevr.decode(datagram, self.drops)
        if content is None:
            return [], []
        tracker = self._trackers.get(address)
        if tracker is not None and content.number:
            if content.number <= tracker.number:
                self.drops["late"] += 1
                return [], []
            tracker.number = content.number
        samples, answers = [], []
        for packet in content.packets:
            if isinstance(packet, Handshake):
                if tracker is None and len(self._trackers) >= MAX_TRACKERS:
                    self.drops["crowded"] += 1
                    continue
                tracker = _Tracker(packet.mac or address[0], packet.protocol, now_s, datagram)
                self._trackers[address] = tracker
                answers.append(Answer(address, slimevr.handshake_reply()))
            elif tracker is None:
                self.drops["stranger"] += 1
            elif isinstance(packet, Rotation):
                if packet.sensor in tracker.rotations:
                    self.drops["unpaired"] += 1
                tracker.rotations[packet.sensor] = packet
            elif isinstance(packet, Acceleration):
                rotation = tracker.rotations.pop(packet.sensor, None)
                if rotation is None:
                    self.drops["unpaired"] += 1
                else:
                    samples.append(self._sample(tracker, rotation, packet))
            elif isinstance(packet, Ping):
                if packet.number == tracker.ping:
                    tracker.round_trips_s.append(now_s - tracker.ping_sent_s)
            elif isinstance(packet, SensorInfo):
                answers.append(Answer(address, slimevr.sensor_info_reply(packet)))
            elif isinstance(packet, slimevr.Features):
                answers.append(Answer(address, slimevr.features_reply()))
        if tracker is not None:
            tracker.heard_s = now_s
        return samples, answers

    def beat(self, now_s: float) -> list[Answer]:
        """What is due: a heartbeat and a ping for each tracker, twice a second. Call it often."""
        if self._beat_due_s is not None and now_s < self._beat_due_s:
            return []
        self._beat_due_s = now_s + BEAT_S
        self._trackers = {a: tracker for a, tracker in self._trackers.items() if now_s - tracker.heard_s < GONE_S}
        answers = []
        for address, tracker in self._trackers.items():
            tracker.ping = (tracker.ping + 1) & 0xFFFFFFFF
            tracker.ping_sent_s = now_s
            answers += [
                Answer(address, slimevr.server_heartbeat()),
                Answer(address, slimevr.ping(tracker.ping)),
            ]
        return answers

    @property
    def trackers(self) -> list[str]:
        """Names of those that shook hands and live."""
        return sorted(tracker.name for tracker in self._trackers.values())

    def introduction(self, address: Address) -> tuple[str, bytes] | None:
        """Name and handshake of the tracker that talks from there; None for a stranger."""
        tracker = self._trackers.get(address)
        return None if tracker is None else (tracker.name, tracker.handshake)

    def _sample(self, tracker: _Tracker, rotation: Rotation, acceleration: Acceleration) -> TrackerSample:
        name = f"{tracker.name}/{acceleration.sensor}"
        turn = self._acc_turn(name)
        if turn is None:
            turn = 0.0 if tracker.protocol >= CONSISTENT_PROTOCOL else BOARD_TURN_RAD
        linear, q = _turned(acceleration.linear, turn), rotation.q
        sample = DeviceSample(
            None,
            with_gravity(linear, q),
            q=q,
            accuracy=rotation.accuracy,
            age_us=round(min(tracker.round_trips_s, default=0.0) * 0.5e6),
        )
        return TrackerSample(name, sample)


def _turned(v: Vec3, angle: float) -> Vec3:
    if angle == 0.0:
        return v
    sine, cosine = math.sin(angle), math.cos(angle)
    return v[0] * cosine - v[1] * sine, v[0] * sine + v[1] * cosine, v[2]
