"""A simulated SlimeVR tracker: datagrams in, datagrams out."""

from __future__ import annotations

from foottrack_service.imu.formats import slimevr
from foottrack_service.imu.formats.slimevr import Acceleration, Handshake, Kind, Rotation
from foottrack_service.imu.sample import DeviceSample, gravity_in_device

REDISCOVER_S = 1.0
TIMEOUT_S = 3.0


class SlimeVrDevice:
    """One tracker with one sensor. Time in seconds on any monotonic clock."""

    def __init__(self, mac: str, bundles: bool = True) -> None:
        self.connected = False
        self._mac = mac
        self._bundles = bundles
        self._number = 0
        self._heard_s = 0.0
        self._searched_s: float | None = None

    def measure(self, sample: DeviceSample) -> list[bytes]:
        """Datagrams of one sample, none while no server has answered. Needs ``q``."""
        if sample.q is None:
            raise ValueError("a SlimeVR tracker sends q")
        if not self.connected:
            return []
        ax, ay, az = (a - g for a, g in zip(sample.acc, gravity_in_device(sample.q), strict=True))
        rotation = Rotation(0, sample.q, sample.accuracy)
        acceleration = Acceleration(0, (ax, ay, az))
        if self._bundles:
            inner = [slimevr.encode_rotation(0, rotation), slimevr.encode_acceleration(0, acceleration)]
            return [slimevr.encode_bundle(self._next(), inner)]
        return [
            slimevr.encode_rotation(self._next(), rotation),
            slimevr.encode_acceleration(self._next(), acceleration),
        ]

    def hear(self, datagram: bytes, now_s: float) -> list[bytes]:
        """Answers to the server."""
        if datagram[:1] == bytes([Kind.HANDSHAKE]):
            self.connected = datagram[1:].startswith(b"Hey OVR =D 5")
            self._heard_s = now_s
            return []
        if not self.connected or len(datagram) < 4:
            return []
        self._heard_s = now_s
        return [datagram] if datagram[3] == Kind.PING else []

    def idle(self, now_s: float) -> list[bytes]:
        """The search for a server, once a second while it has none. To be sent to the broadcast address."""
        if self.connected and now_s - self._heard_s > TIMEOUT_S:
            self.connected = False
        if self.connected or (self._searched_s is not None and now_s - self._searched_s < REDISCOVER_S):
            return []
        self._searched_s = now_s
        return [slimevr.encode_handshake(Handshake(22, "foottrack-simulated", self._mac))]

    def _next(self) -> int:
        self._number += 1
        return self._number
