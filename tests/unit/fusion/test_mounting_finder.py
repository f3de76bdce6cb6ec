"""``calibrate mounting`` beside a bus on which a foot stands and steps; and its finder alone."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest
from test_imu_mounting import one_step

from foottrack_protocol.messages import Imu, ImuCalibration
from foottrack_service import rotations as rot
from foottrack_service.bus import Broker, Bus
from foottrack_service.bus.control import ControlServer
from foottrack_service.cli.calibrate_mounting import MountingFinder, calibrate
from foottrack_service.cli.running import CommandFailed
from foottrack_service.config import FootSettings, Settings

TURN = [-0.6, -1.5, 0.4]


@asynccontextmanager
async def told_the_time(broker: Broker) -> AsyncIterator[Settings]:
    """Where the command finds the broker, and a control socket that tells the time."""
    server = ControlServer(broker.context, "tcp://127.0.0.1:0", {})
    serving = asyncio.ensure_future(server.run())
    try:
        yield Settings(bus=broker.endpoints.model_copy(update={"control": server.endpoint}))
    finally:
        server.close()
        await serving


@pytest.mark.parametrize("kind", ["raw", "fused"])
def test_three_seconds_and_a_step_are_enough(kind: str) -> None:
    samples, q = one_step(TURN, kind, 3)
    finder = MountingFinder(FootSettings(), "left")
    for sample in samples:
        finder.add(sample)
    assert finder.values is not None
    assert np.rad2deg(rot.angle_between(np.array(finder.values.q), q)) < 5.0
    assert finder.values.p == FootSettings().imu.p


def test_stamps_that_go_back_begin_anew_and_repeated_ones_do_nothing() -> None:
    samples, q = one_step(TURN, "raw", 3)
    finder = MountingFinder(FootSettings(), "left")
    for sample in samples[:700]:
        finder.add(sample)
    assert finder.rested
    finder.add(samples[698])
    assert finder.rested
    finder.add(samples[0])
    assert not finder.rested
    for sample in samples:
        finder.add(sample)
    assert finder.values is not None
    assert np.rad2deg(rot.angle_between(np.array(finder.values.q), q)) < 5.0


def test_what_is_found_is_published(broker: Broker, bus: Bus, run: Any) -> None:
    samples, q = one_step(TURN, "fused", 3)

    async def play() -> None:
        publisher = bus.publisher("imu-left")
        await publisher.ready()
        while True:
            # One turn after another: a listener that came late hears the next one from its beginning.
            for k, s in enumerate(samples):
                assert s.q is not None
                body = Imu(acc=tuple(s.acc.tolist()), q=tuple(s.q.tolist()), t_arr=0)
                publisher.publish("user", "imu/left", s.t, body)
                if k % 20 == 0:
                    await asyncio.sleep(0.001)

    async def both() -> Any:
        heard = bus.subscriber(["user/calibration"])
        await heard.ready()
        playing = asyncio.create_task(play())
        try:
            async with told_the_time(broker) as settings:
                found = await calibrate(settings, 20.0, lambda text: None)
            while True:
                for received in heard.drain():
                    return found, received.message.data
                await asyncio.sleep(0.01)
        finally:
            playing.cancel()

    found, published = run(both())
    assert list(found) == ["left"]
    assert published == ImuCalibration(values=found["left"])
    assert np.rad2deg(rot.angle_between(np.array(found["left"].q), q)) < 5.0


def test_without_imus_it_says_so(broker: Broker, run: Any) -> None:
    async def alone() -> None:
        async with told_the_time(broker) as settings:
            await calibrate(settings, 20.0, lambda text: None)

    with pytest.raises(CommandFailed, match="no IMU is heard"):
        run(alone())
