"""What `foottrack doctor` says of clocks: this host's against the bus's, and how old each stream's stamps arrive."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from foottrack_protocol.topics import TOPICS, Role
from foottrack_service.cli.findings import Finding

if TYPE_CHECKING:
    from foottrack_service.bus.connection import Bus
    from foottrack_service.bus.control_client import ControlClient

LISTEN_S = 1.0
OLD_S = 0.2
"""Poses and finds that are older when they arrive help little."""


async def clock(client: ControlClient) -> Finding:
    """How this host's clock lies against the bus clock."""
    from foottrack_service.bus.timesync import SyncedClock, measure

    async def ask() -> int:
        return int((await client.request("time", timeout_s=0.5))["t"])

    synced = SyncedClock()
    synced.on_burst(await measure(ask))
    if synced.offset is None or synced.uncertainty is None:
        return Finding("warning", "clock", "the service does not tell the time quickly enough", "Is the host busy?")
    text = f"bus clock {1e-6 * synced.offset:+.3f} ms off ours, known to {1e-6 * synced.uncertainty:.3f} ms"
    if abs(synced.offset) <= synced.uncertainty:
        return Finding("ok", "clock", f"{text}: the same one")
    return Finding("ok", "clock", text, "Another host's: its publishers have to convert their stamps.")


async def stamps(bus: Bus, user: str, listen_s: float = LISTEN_S) -> list[Finding]:
    """How old the measurements' stamps are on arrival, each stream's. ``bus`` has the service's clock."""
    measured = [f"{user}/{topic.stream}" for topic in TOPICS.values() if topic.role is Role.MEASUREMENT]
    ages: dict[str, list[float]] = defaultdict(list)
    subscriber = bus.subscriber(measured)
    await subscriber.ready()
    loop = asyncio.get_running_loop()
    until = loop.time() + listen_s
    while loop.time() < until:
        for received in subscriber.drain():
            ages[received.message.topic].append((received.arrival - received.message.t) * 1e-9)
        await asyncio.sleep(0.01)
    return [judged(topic, values) for topic, values in sorted(ages.items())]


def judged(topic: str, ages_s: Iterable[float]) -> Finding:
    """What a stream's ages, s, say of its clock and latency."""
    low, middle, high = np.percentile(list(ages_s), [5, 50, 95])
    subject = f"stamps of {topic}"
    text = f"{1e3 * middle:.1f} ms old on arrival (5 to 95 %: {1e3 * low:.1f} to {1e3 * high:.1f})"
    if low < 0.0:
        return Finding("warning", subject, text, "They lie in the future: a clock is off, or a latency set too large.")
    if middle > OLD_S:
        return Finding("warning", subject, text, "Too old to help: its clock is off, or its source too slow.")
    return Finding("ok", subject, text)
