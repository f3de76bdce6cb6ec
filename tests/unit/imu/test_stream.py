"""Settings, and bytes to messages of the wire."""

from __future__ import annotations

import math

import numpy as np
import pytest
from imu_streams import DEVICES, motion
from pydantic import ValidationError

from foottrack_service import rotations
from foottrack_service.imu.devices.bno08x import Bno08xDevice
from foottrack_service.imu.sample import DeviceSample
from foottrack_service.imu.settings import ImuDeviceSettings
from foottrack_service.imu.stream import SerialStream, Stamper

START = 10**12
PERIOD = 10_000_000


@pytest.mark.parametrize("name", ["ascii", "rvc", "raw"])
def test_jittered_bytes_become_regular_messages_in_the_wires_axes(name: str) -> None:
    stream = SerialStream(ImuDeviceSettings(format=name, delay=0.003))  # type: ignore[arg-type]
    device = DEVICES[name]()
    rng = np.random.default_rng(0)
    errors = []
    for k, sample in enumerate(motion(1500, 10_000)):
        (message,) = stream.feed(device.measure(sample), START + k * PERIOD + int(rng.exponential(3e6)))
        errors.append(message.t - (START + k * PERIOD - 3_000_000))
        assert message.imu.acc == pytest.approx((sample.acc[0], sample.acc[2], -sample.acc[1]), abs=0.01)
    assert np.std(errors[500:]) < 0.5e6
    assert abs(np.mean(errors[500:])) < 0.5e6
    assert not any(stream.drops.values())


def test_options_reach_the_decoder() -> None:
    stream = SerialStream(ImuDeviceSettings(format="ascii", separator="|", tick=1e-3))
    (message,) = stream.feed(b"7|L|0|0|0;7|R|1|0|0|0;", START)
    assert message.imu.t_dev == 7000
    bno = SerialStream(ImuDeviceSettings(format="bno08x", rate=100.0))
    device = Bno08xDevice()
    for now_s in (0.0, 0.01):
        for frame in bno.to_send(now_s):
            bno.feed(device.hear(frame), START)
    assert set(device.intervals_us.values()) == {10_000}


def test_a_replugged_device_is_configured_anew_and_its_counts_go_on() -> None:
    stream, device = SerialStream(ImuDeviceSettings(format="bno08x")), Bno08xDevice()
    assert stream.feed(b"\x7e\x05garbage\x7e", START) == []
    stream.replugged()
    assert stream.drops["protocol"] == 1
    assert len(stream.to_send(0.0)) == 1
    assert device.intervals_us == {}


def test_a_device_that_starts_anew_is_a_new_clock() -> None:
    stream, device = SerialStream(ImuDeviceSettings(format="bno08x")), Bno08xDevice()
    t = START
    for turn in range(2):
        stream.feed(device.start(), t)
        for frame in stream.to_send(100.0 * turn):
            stream.feed(device.hear(frame), t)
        for sample in motion(300, 2500):
            t += 2_500_000
            for message in stream.feed(device.measure(sample), t):
                assert abs(message.t - t) < 1_000_000
        t += 777_000_000
    assert stream.stamper.dejitter.resets == 1


def test_other_axes() -> None:
    stamper = Stamper(ImuDeviceSettings(axes="+x+y+z"), None)
    stamped = stamper.stamp(DeviceSample(None, (1.0, 2.0, 3.0), q=(0.0, 0.0, 0.0, 1.0)), START, None)
    assert stamped is not None
    assert stamped.imu.acc == (1.0, 2.0, 3.0)
    # The world still has to be turned: what was up on z is up on y.
    half = math.sqrt(0.5)
    assert rotations.angle_between(stamped.imu.q, (-half, 0.0, 0.0, half)) < 1e-9


def test_what_the_wire_would_refuse_is_counted() -> None:
    stamper = Stamper(ImuDeviceSettings(), None)
    assert stamper.stamp(DeviceSample(None, (math.nan, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0)), START, None) is None
    assert stamper.stamp(DeviceSample(None, (0.0, 0.0, 9.8)), START, None) is None
    assert stamper.drops == {"wire": 2}


@pytest.mark.parametrize(
    "wrong",
    [
        {"format": "bno055"},
        {"axes": "+x+y+y"},
        {"axes": "north"},
        {"separator": ";"},
        {"separator": "1"},
        {"delay": -0.1},
        {"delay": math.nan},
        {"baud": 0},
        {"rate": 0.0},
        {"prot": "COM3"},
    ],
)
def test_settings_that_cannot_be_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        ImuDeviceSettings(**wrong)  # type: ignore[arg-type]
