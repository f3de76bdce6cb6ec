"""The fusion node: the core on a live bus."""

from __future__ import annotations

import asyncio
import gc
import uuid

from foottrack_protocol import Message
from foottrack_protocol.topics import TOPICS, Role
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.publisher import Publisher
from foottrack_service.bus.subscriber import Received
from foottrack_service.config import Settings
from foottrack_service.fusion.core import SOURCE, FusionCore
from foottrack_service.fusion.foot_filter import warm_up

_HEALTH_PERIOD_NS = 500_000_000
_IDLE_NS = 20_000_000
_INPUTS = (Role.MEASUREMENT, Role.CALIBRATION)


async def run(bus: Bus, settings: Settings) -> None:
    """Fuse what arrives for the settings' user until cancelled."""
    if settings.fusion.filter == "error-state":
        # Beside the loop: what is held up here, serial bytes for one, would be stamped late.
        await asyncio.to_thread(warm_up)
    # What is loaded by now stays. Looking through it for garbage held a pose up for 115 ms.
    gc.freeze()
    publisher = bus.publisher(SOURCE)
    subscriber = bus.subscriber(
        [f"{settings.user}/{topic.stream}" for topic in TOPICS.values() if topic.role in _INPUTS]
    )
    await publisher.ready()
    await subscriber.ready()
    live = _LiveCore(bus, settings, publisher)
    bus.health.node(SOURCE, "running")
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(live.timer())
        await subscriber.deliver(live.fuse)


class _LiveCore:
    """The core, its results published as they come, and how long an IMU's sample took to become a pose."""

    def __init__(self, bus: Bus, settings: Settings, publisher: Publisher) -> None:
        self._bus, self._user = bus, settings.user
        self._publisher = publisher
        self._core = FusionCore(settings, uuid.uuid4().hex[:12], self._send)
        self._sampled: int | None = None

    def fuse(self, batch: list[Received]) -> None:
        """Take what arrived."""
        clock, core = self._bus.clock, self._core
        for received in batch:
            message = received.message
            self._sampled = message.data.t_arr if message.stream.startswith("imu/") else None
            core.handle(message, clock())

    async def timer(self) -> None:
        """Publish in silence, and say how the filters are."""
        clock, core = self._bus.clock, self._core
        reported = 0
        while True:
            now = clock()
            self._sampled = None
            core.tick(now)
            if now - reported > _HEALTH_PERIOD_NS:
                reported = now
                for name, health in core.health.items():
                    self._bus.health.filter(name, health.accepted, health.rejected)
                mount = core.mount_health
                if mount is not None:
                    self._bus.health.filter(f"{self._user}/mount", mount.accepted, mount.rejected)
            deadline = core.deadline
            wait_ns = _IDLE_NS if deadline is None else deadline - clock()
            await asyncio.sleep(max(wait_ns, 1_000_000) * 1e-9)

    def _send(self, result: Message) -> None:
        self._publisher.send(result)
        if self._sampled is not None and result.stream == "pose/body":
            self._bus.health.latency(self._bus.clock() - self._sampled)
