"""The fake publishers on a real bus."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from foottrack_protocol import Message
from foottrack_service.bus import Bus
from foottrack_service.config import Settings
from foottrack_service.simulation import node
from foottrack_service.simulation.scenario import simulate

Run = Callable[..., Any]


def test_a_scenario_arrives_whole_and_on_the_bus_clock(run: Run, bus: Bus) -> None:
    scenario = simulate("walk", 1, seconds=1.0)
    expected = [message for _, message in scenario.messages()]
    told: list[float] = []

    async def play() -> list[Message]:
        subscriber = bus.subscriber(["user/"])
        await subscriber.ready()
        begun = bus.clock()
        publishing = asyncio.create_task(node.run(bus, Settings(), scenario, progress=told.append))
        received: list[Message] = []
        async for batch in subscriber.batches():
            received += [item.message for item in batch]
            if len(received) >= len(expected):
                break
        counted = await publishing
        assert sum(counted.values()) == len(expected)
        assert bus.clock() - begun > 0.9e9, "in real time"
        assert all(m.t > begun and m.t_pub >= m.t for m in received if not m.stream.startswith("depth"))
        return received

    received = run(play())
    for stream in {message.stream for message in expected}:
        sent = [m for m in expected if m.stream == stream]
        came = [m for m in received if m.stream == stream]
        assert [m.seq for m in came] == [m.seq for m in sent]
        start = came[0].t - sent[0].t
        assert all(a.t - b.t == start for a, b in zip(came, sent, strict=True)), "one shift for all stamps"
    assert {m.src for m in received} == {"imu-left", "imu-right", "camera", "headset", "truth"}
    assert len({m.sid for m in received}) == 5, "each device is a publisher of its own"
    assert told == sorted(told)
    assert 5 <= len(told) <= 11


def test_stopping_it_closes_its_publishers(run: Run, bus: Bus) -> None:
    async def play() -> None:
        subscriber = bus.subscriber(["user/imu/"])
        await subscriber.ready()
        publishing = asyncio.create_task(node.run(bus, Settings(), simulate("still", 1, seconds=60.0)))
        async for _ in subscriber.batches():
            break
        publishing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await publishing

    run(play())
