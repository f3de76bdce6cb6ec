"""The fusion node: the core on a live bus."""

from __future__ import annotations

import asyncio
import uuid

from foottrack_protocol import Message
from foottrack_protocol.topics import TOPICS, Role
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.publisher import Publisher
from foottrack_service.bus.subscriber import Received
from foottrack_service.config import Settings
from foottrack_service.fusion.core import SOURCE, FusionCore

_HEALTH_PERIOD_NS = 500_000_000
_INPUTS = (Role.MEASUREMENT, Role.CALIBRATION)


async def run(bus: Bus, settings: Settings) -> None:
    """Fuse what arrives for the settings' user until cancelled."""
    core = FusionCore(settings, sid=uuid.uuid4().hex[:12])
    publisher = bus.publisher(SOURCE)
    subscriber = bus.subscriber(
        [f"{settings.user}/{topic.stream}" for topic in TOPICS.values() if topic.role in _INPUTS]
    )
    await publisher.ready()
    await subscriber.ready()
    bus.health.node(SOURCE, "running")
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(_timer(bus, core, publisher))
        await subscriber.deliver(lambda batch: _fuse(bus, core, publisher, batch))


def _fuse(bus: Bus, core: FusionCore, publisher: Publisher, batch: list[Received]) -> None:
    for received in batch:
        results = core.handle(received.message, bus.clock())
        if results:
            _send(publisher, results)
            if received.message.stream.startswith("imu/"):
                bus.health.latency(bus.clock() - received.message.data.t_arr)


async def _timer(bus: Bus, core: FusionCore, publisher: Publisher) -> None:
    reported = 0
    while True:
        now = bus.clock()
        _send(publisher, core.tick(now))
        if now - reported > _HEALTH_PERIOD_NS:
            reported = now
            for name, health in core.health.items():
                bus.health.filter(name, health.accepted, health.rejected)
        deadline = core.deadline
        wait_ns = 5_000_000 if deadline is None else deadline - bus.clock()
        await asyncio.sleep(max(wait_ns, 1_000_000) * 1e-9)


def _send(publisher: Publisher, messages: list[Message]) -> None:
    for message in messages:
        publisher.send(message)
