"""Fault runs of ``foottrack bench --faults``: what is lost when a part of the system fails."""

from __future__ import annotations

import asyncio
import multiprocessing
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import numpy as np

from foottrack_protocol.frames import SIDES, STANDARD_GRAVITY
from foottrack_protocol.messages import Imu
from foottrack_service.app import NODES, Service
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.publisher import Publisher
from foottrack_service.config import BusSettings, Settings
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.offline import fuse
from foottrack_service.simulation.faults import HeadsetRecentred
from foottrack_service.simulation.scenario import simulate

_PERIOD_S = 1 / 200
_STALL_S = 10.0
_BACK_WITHIN_M = 0.05


async def fault_runs() -> dict[str, Any]:
    """Each fault with what it cost."""
    return {
        "publisher_killed": await _publisher_killed(),
        "subscriber_stalled": await _subscriber_stalled(),
        "bus_restarted": await _bus_restarted(),
        "headset_recentred": {"known": _recentred(known=True), "unknown": _recentred(known=False)},
    }


async def _publisher_killed() -> dict[str, Any]:
    """A publisher in a process of its own is killed after a second and started again."""
    context = multiprocessing.get_context("spawn")
    async with _running() as service:
        subscriber = service.bus.subscriber(["user/imu/left"])
        await subscriber.ready()
        last_before, first_after = 0, 0
        for life in range(2):
            process = context.Process(target=_publish_forever, args=(service.endpoints.model_dump(),), daemon=True)
            process.start()
            count = 0
            async for item in subscriber:
                count += 1
                if life == 1 and count == 1:
                    first_after = item.arrival
                if count == 200:
                    break
                last_before = item.arrival if life == 0 else last_before
            process.kill()
            process.join()
            subscriber.drain()
        stats = subscriber.stats.topics["user/imu/left"]
        return {
            "received": stats.messages,
            "lost": stats.gaps,
            "silence_s": round((first_after - last_before) * 1e-9, 3),
        }


async def _subscriber_stalled() -> dict[str, Any]:
    """A subscriber of everything does not read for 10 s."""
    async with _running() as service:
        with Bus.connect(service.endpoints) as slow:
            subscriber = slow.subscriber()
            publisher = service.bus.publisher("imu-left")
            await subscriber.ready()
            await publisher.ready()
            await _publish_for(publisher, service.bus, _STALL_S)
            backlog = 0
            oldest: int | None = None
            while batch := subscriber.drain():
                oldest = oldest or batch[0].message.t_pub
                backlog += len(batch)
                await asyncio.sleep(0)
            lost = sum(stats.gaps for stats in subscriber.stats.topics.values())
            others = service.bus.health.body().topics["user/imu/left"].gaps
            return {"stalled_s": _STALL_S, "backlog": backlog, "lost": lost, "lost_by_others": others}


async def _bus_restarted() -> dict[str, Any]:
    """The service ends and starts again on the same ports while a publisher and a subscriber live on."""
    lives = AsyncExitStack()
    first = await lives.enter_async_context(_running())
    settings = Settings(bus=first.endpoints.model_dump())
    with Bus.connect(first.endpoints) as device, Bus.connect(first.endpoints) as engine:
        publisher, subscriber = device.publisher("imu-left"), engine.subscriber(["user/imu/left"])
        await publisher.ready()
        await subscriber.ready()
        await _publish_for(publisher, device, 0.5)
        await lives.aclose()
        down = time.perf_counter()
        await _publish_for(publisher, device, 0.5)
        async with _running(settings):
            up = time.perf_counter()
            connections = subscriber.connections
            while subscriber.connections == connections or publisher.connections < 2:
                await _publish_for(publisher, device, _PERIOD_S)
                subscriber.drain()
            back = time.perf_counter()
            await _publish_for(publisher, device, 0.5)
            subscriber.drain(100_000)
        return {
            "down_s": round(up - down, 3),
            "back_after_s": round(back - up, 3),
            "not_sent_while_down": sum(publisher.drops.values()),
            "lost": subscriber.stats.topics["user/imu/left"].gaps,
        }


def _recentred(known: bool) -> dict[str, Any]:
    """The stage is turned and moved in the middle of a stand; the worst error of either foot from then on."""
    at, settings = 4.0, Settings()
    fault = HeadsetRecentred(start=at, known=known)
    scenario = simulate("still", 1, settings=settings, seconds=8.0, faults=[fault])
    arrivals = list(scenario.messages())
    truth = {
        side: {message.t: message.data.p for _, message in arrivals if message.stream == f"truth/{side}"}
        for side in SIDES
    }
    stamps = np.array(sorted(truth["left"]))
    worst, missing, back = 0.0, 0, at
    for out in fuse(arrivals, FusionCore(settings)):
        seconds = (out.t - scenario.start) * 1e-9
        if out.stream != "pose/body" or seconds < at + 0.1 or seconds > 7.9:
            continue
        nearest = int(stamps[np.argmin(np.abs(stamps - out.t))])
        for side in SIDES:
            foot = getattr(out.data, side)
            if foot is None or foot.stage == "lost":
                missing += 1
                continue
            error = float(np.linalg.norm(np.subtract(foot.ankle.p, truth[side][nearest])))
            worst = max(worst, error)
            if error > _BACK_WITHIN_M:
                back = seconds
    return {"worst_mm": round(worst * 1e3, 1), "outputs_without_foot": missing, "back_after_s": round(back - at, 2)}


@asynccontextmanager
async def _running(settings: Settings | None = None) -> AsyncIterator[Service]:
    async with Service(settings or Settings(bus=BusSettings.beginning_at("0").model_dump())) as service:
        service.start(NODES["fusion"])
        await service.running("fusion")
        yield service


async def _publish_for(publisher: Publisher, bus: Bus, seconds: float) -> None:
    begin = time.perf_counter()
    for number in range(max(1, round(seconds / _PERIOD_S))):
        publisher.publish("user", "imu/left", bus.clock(), _still(bus.clock()))
        await asyncio.sleep(max(0.0, begin + (number + 1) * _PERIOD_S - time.perf_counter()))


def _publish_forever(endpoints: dict[str, str]) -> None:
    with Bus.connect(BusSettings(**endpoints)) as bus:
        publisher = bus.publisher("imu-left")
        publisher.wait_ready()
        while True:
            publisher.publish("user", "imu/left", bus.clock(), _still(bus.clock()))
            time.sleep(_PERIOD_S)


def _still(now: int) -> Imu:
    return Imu(acc=(0.0, STANDARD_GRAVITY, 0.0), q=(0.0, 0.0, 0.0, 1.0), t_arr=now)
