"""The simulation's IMU through a device's bytes and back: the same samples, at steadier times."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service.config import Settings
from foottrack_service.imu.axes import Axes
from foottrack_service.imu.devices.plugged import DEVICES
from foottrack_service.imu.settings import ImuDeviceSettings
from foottrack_service.imu.stream import SerialStream
from foottrack_service.simulation.scenario import simulate

START = 10**12


@pytest.mark.parametrize(
    ("kind", "name", "hz", "resolution"),
    [("fused", "rvc", 100.0, 0.006), ("fused", "ascii", 100.0, 0.003), ("raw", "raw", 200.0, 1e-4)],
)
def test_a_walk_survives_the_wire(kind: str, name: str, hz: float, resolution: float) -> None:
    scenario = simulate("line", 1, settings=Settings(), seconds=12.0, imu_hz=hz, imu=kind)  # type: ignore[arg-type]
    device, axes = DEVICES[name](), Axes()
    stream = SerialStream(ImuDeviceSettings(format=name))  # type: ignore[arg-type]
    stamp_errors, arrival_errors = [], []
    for _, message in scenario.at(START).messages():
        if message.stream != "imu/left":
            continue
        sent = message.data
        sample = axes.from_wire(sent.acc, sent.gyro, sent.q, sent.t_dev)
        (received,) = stream.feed(device.measure(sample), sent.t_arr)
        np.testing.assert_allclose(received.imu.acc, sent.acc, atol=resolution)
        if sent.gyro is not None:
            np.testing.assert_allclose(received.imu.gyro, sent.gyro, atol=1e-5)
        stamp_errors.append((received.t - message.t) * 1e-6)
        arrival_errors.append((sent.t_arr - message.t) * 1e-6)
    assert len(stamp_errors) > 11.0 * hz
    assert not any(stream.drops.values())
    assert stream.stamper.dejitter.resets == 0
    # The least delay stays (nothing on this side can know it); what varies is taken out.
    assert np.std(stamp_errors[200:]) < 0.5 * np.std(arrival_errors[200:])
    assert np.mean(stamp_errors) < np.mean(arrival_errors)
