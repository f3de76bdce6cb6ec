"""Finding out what talks on a port."""

from __future__ import annotations

import asyncio
import random
import sys
from typing import Any

import pytest

from foottrack_protocol.messages import Imu
from foottrack_service.imu.devices.plugged import DEVICES, PluggedImu
from foottrack_service.imu.devices.pty_port import PtyPort
from foottrack_service.imu.formats.guess import guess_format
from foottrack_service.imu.probe import probe
from foottrack_service.imu.sample import DeviceSample

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")


@posix
@pytest.mark.parametrize("name", sorted(DEVICES))
def test_each_device_is_recognised(name: str, run: Any) -> None:
    async def play(imu: PluggedImu) -> None:
        for k in range(10_000):
            body = Imu(acc=(0.0, 9.8, 0.0), gyro=(0.0, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0), t_dev=k * 5000, t_arr=0)
            imu.send(body)
            await asyncio.sleep(0.005)

    async def scenario() -> Any:
        imu = PluggedImu(name)
        playing = asyncio.create_task(play(imu))
        try:
            return await probe(imu.port, listen_s=5.0 if name != "bno08x" else 0.5)
        finally:
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)
            imu.close()

    found = run(scenario())
    assert found.format == name
    assert found.heard > 0
    # A pty has no baud rate, so the first that is tried is as good; only the chip that is woken needs its own.
    assert found.baud == (3_000_000 if name == "bno08x" else 115_200)


@posix
def test_a_silent_port_is_no_imu(run: Any) -> None:
    with PtyPort() as pty:
        assert run(probe(pty.port, listen_s=0.05)) == (None, None, 0)


def test_a_port_that_is_not_there(run: Any) -> None:
    with pytest.raises(OSError, match="nowhere"):
        run(probe("/dev/nowhere"))


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_other_peoples_text_are_no_imu(seed: int) -> None:
    assert guess_format(random.Random(seed).randbytes(4000)) is None
    assert guess_format(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n" * 30) is None
    assert guess_format(b"") is None


def test_a_stream_that_begins_in_a_message() -> None:
    device = DEVICES["raw"]()
    stream = b"".join(device.measure(DeviceSample(k, (0.0, 0.0, 9.8), (0.0, 0.0, 0.0))) for k in range(10))
    assert guess_format(stream[17:]) == "raw"
