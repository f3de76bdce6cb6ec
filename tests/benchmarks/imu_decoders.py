"""Bytes per second that the IMU decoders sustain: ``python tests/benchmarks/imu_decoders.py``."""

from __future__ import annotations

import struct
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "unit" / "imu"))

from imu_streams import DEVICES, connected, motion

from foottrack_service.imu.formats import SERIAL_FORMATS, slimevr
from foottrack_service.imu.formats.slimevr import Acceleration, Handshake, Rotation
from foottrack_service.imu.settings import ImuDeviceSettings
from foottrack_service.imu.slimevr import SlimeVrServer
from foottrack_service.imu.stream import SerialStream

COUNT = 20_000
CHUNK = 64
"""Bytes: about what one read of a serial port gives."""
REPEATS = 5


def serial(name: str) -> None:
    _, device = connected(name)
    stream = b"".join(device.measure(sample) for sample in motion(COUNT, 2500))
    best = wire = float("inf")
    for _ in range(REPEATS):
        decoder, _ = connected(name)
        begin = time.perf_counter()
        samples = 0
        for at in range(0, len(stream), CHUNK):
            samples += len(decoder.feed(stream[at : at + CHUNK]))
        best = min(best, time.perf_counter() - begin)
        assert samples == COUNT
        whole = SerialStream(ImuDeviceSettings(format=name))  # type: ignore[arg-type]
        whole.decoder = connected(name).decoder
        begin = time.perf_counter()
        for k, at in enumerate(range(0, len(stream), CHUNK)):
            whole.feed(stream[at : at + CHUNK], k * CHUNK * COUNT * 2_500_000 // len(stream))
        wire = min(wire, time.perf_counter() - begin)
    line = SERIAL_FORMATS[name].baud / 10.0
    rate = len(stream) / best
    print(
        f"{name:8} {len(stream) / COUNT:5.1f} B/sample  {rate / 1e6:6.2f} MB/s = {rate / line:5.1f} x its line  "
        f"{best / COUNT * 1e6:5.1f} us/sample, with stamp, axes and validation {wire / COUNT * 1e6:5.1f}"
    )


def trackers() -> None:
    rotation, acceleration = Rotation(0, (0.0, 0.0, 0.0, 1.0), 3), Acceleration(0, (1.0, 2.0, 3.0))
    inner = [slimevr.encode_rotation(0, rotation), slimevr.encode_acceleration(0, acceleration)]
    bundle = slimevr.encode_bundle(0, inner)
    datagrams = [bundle[:4] + struct.pack(">Q", number) + bundle[12:] for number in range(1, COUNT + 1)]
    best = float("inf")
    for _ in range(REPEATS):
        server = SlimeVrServer()
        server.receive(slimevr.encode_handshake(Handshake(22, "x", "A0:00:00:00:00:01")), ("h", 1), 0.0)
        begin = time.perf_counter()
        samples = sum(len(server.receive(datagram, ("h", 1), 0.0)[0]) for datagram in datagrams)
        best = min(best, time.perf_counter() - begin)
        assert samples == COUNT
    size = len(bundle)
    print(f"slimevr  {size:5.1f} B/sample  {size * COUNT / best / 1e6:6.2f} MB/s  {best / COUNT * 1e6:5.1f} us/sample")


if __name__ == "__main__":
    for each in sorted(DEVICES):
        serial(each)
    trackers()
