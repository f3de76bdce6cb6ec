"""Fake publishers: a scenario on a running bus, in real time."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable

from foottrack_service.bus.connection import Bus
from foottrack_service.config import Settings
from foottrack_service.simulation.scenario import Scenario

_LEAD_NS = 20_000_000
"""So much before the first sample everything is ready."""


async def run(
    bus: Bus,
    settings: Settings,
    scenario: Scenario,
    *,
    progress: Callable[[float], None] | None = None,
    ready_timeout_s: float = 5.0,
) -> Counter[str]:
    """Publish a scenario for `settings.user` from now on, each device from a publisher of its own, until it ends.

    Stamps are on the bus clock. Every message has its deadline from the start of the run, so lateness does not add up.
    `progress` is told the s that are over, at most 10 times a second. Says how many messages of each stream were
    published. Raises NotReady when no bus answers.
    """
    sources = sorted({emission.src for emission in scenario.emissions})
    publishers = {src: bus.publisher(src) for src in sources}
    published: Counter[str] = Counter()
    try:
        for publisher in publishers.values():
            await publisher.ready(ready_timeout_s)
        start = bus.clock() + _LEAD_NS
        told = 0.0
        for _, message in scenario.at(start).messages():
            wait = message.t_pub - bus.clock()
            if wait > 0:
                await asyncio.sleep(wait * 1e-9)
            publishers[message.src].publish(settings.user, message.stream, message.t, message.data, message.valid)
            published[message.stream] += 1
            over = (message.t_pub - start) * 1e-9
            if progress is not None and over >= told + 0.1:
                told = over
                progress(over)
    finally:
        for publisher in publishers.values():
            publisher.close()
    return published
