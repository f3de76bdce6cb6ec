"""Byte streams of every serial format, as its device sends them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foottrack_service import rotations
from foottrack_service.imu.devices.plugged import DEVICES
from foottrack_service.imu.devices.serial_devices import SimulatedDevice
from foottrack_service.imu.formats import SERIAL_FORMATS
from foottrack_service.imu.formats.bno08x import Bno08xDecoder
from foottrack_service.imu.sample import Decoder, DeviceSample, gravity_in_device

RESOLUTION = {
    # acc m/s^2, gyro rad/s, q
    "ascii": (2.5e-3, None, 1e-4),
    "rvc": (0.005, None, 2e-4),
    "bno08x": (0.002, 0.001, 1e-4),
    "raw": (1e-5, 1e-6, None),
}


class Pair(NamedTuple):
    """A decoder, and a device that it has configured."""

    decoder: Decoder
    device: SimulatedDevice


def connected(name: str) -> Pair:
    decoder, device = SERIAL_FORMATS[name].decoder(), DEVICES[name]()
    now_s = 0.0
    for _ in range(3):
        for frame in decoder.to_send(now_s):
            assert decoder.feed(device.hear(frame)) == []
        now_s += 0.01
    assert not any(decoder.drops.values())
    return Pair(decoder, device)


def motion(count: int, period_us: int, seed: int = 0, start_us: int = 1_000_000) -> list[DeviceSample]:
    """A tumbling, shaken sensor."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    start = rotations.normalised(rng.normal(size=4))
    samples = []
    for k in range(count):
        t = k * period_us * 1e-6
        q = tuple(float(v) for v in rotations.multiply(start, rotations.from_axis_angle(axis, 3.0 * t)))
        shake = 5.0 * np.sin(20.0 * t + np.arange(3))
        acc = tuple(float(v) for v in np.asarray(gravity_in_device(q)) + shake)  # type: ignore[arg-type]
        gyro = tuple(float(v) for v in 3.0 * axis)
        samples.append(DeviceSample(start_us + k * period_us, acc, gyro, q, accuracy=2))  # type: ignore[arg-type]
    return samples


def reconfigured(decoder: Decoder, device: SimulatedDevice, now_s: float) -> None:
    assert isinstance(decoder, Bno08xDecoder)
    for frame in decoder.to_send(now_s):
        decoder.feed(device.hear(frame))
