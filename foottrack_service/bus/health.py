"""``sys/health``: how the service is, once a second and in the answer to ``status``."""

from __future__ import annotations

import asyncio
import math
from collections import Counter, deque
from collections.abc import Mapping
from typing import Literal

from foottrack_protocol.messages import FilterHealth, Health, Latency, NodeHealth, TopicHealth
from foottrack_protocol.topics import SYSTEM
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.publisher import Publisher
from foottrack_service.bus.sequence import Stats, TopicStats
from foottrack_service.bus.subscriber import Subscriber

NodeState = Literal["starting", "running", "restarting", "failed", "stopped"]

_MAX_COUNT = 2**53
"""Where a count stops: a publisher may claim any ``seq``, and JSON readers know no larger integers."""
_MAX_LATENCIES = 10_000
_DRAIN_PERIOD_S = 0.05
"""The monitor looks so often, instead of waking for each message: that alone would cost more than decoding."""


class HealthBoard:
    """Where all parts of a process report how they are. Belongs to one thread."""

    def __init__(self) -> None:
        self._nodes: dict[str, NodeHealth] = {}
        self._running: dict[str, asyncio.Event] = {}
        self._filters: dict[str, FilterHealth] = {}
        self._latencies: deque[int] = deque(maxlen=_MAX_LATENCIES)
        self._seen: dict[str, int] = {}
        self._ticked: int | None = None
        self._topics: dict[str, TopicHealth] = {}
        self._drops: dict[str, int] = {}
        self._refused: Counter[str] = Counter()
        self._turned_away: dict[str, Mapping[str, int]] = {}
        self._latency: Latency | None = None

    def node(self, name: str, state: NodeState, error: str | None = None) -> None:
        """A node's state; "restarting" counts one restart."""
        before = self._nodes.get(name)
        restarts = (before.restarts if before else 0) + (state == "restarting")
        self._nodes[name] = NodeHealth(state=state, restarts=restarts, error=error)
        event = self._running.setdefault(name, asyncio.Event())
        if state == "running":
            event.set()
        else:
            event.clear()

    async def wait_running(self, name: str) -> None:
        """Wait until a node says that it runs: what is published from then on reaches it."""
        await self._running.setdefault(name, asyncio.Event()).wait()

    def filter(self, name: str, accepted: Mapping[str, int], rejected: Mapping[str, int]) -> None:
        """What the filter ``user/side`` did with its measurements since its start: by kind, by reason."""
        self._filters[name] = FilterHealth(accepted=dict(accepted), rejected=dict(rejected))

    def latency(self, ns: int) -> None:
        """One IMU sample's arrival to the hand-over of the pose it brought on."""
        self._latencies.append(ns)

    def refuse(self, reason: str) -> None:
        """Something was refused that names no topic: a control request."""
        self._refused[reason] += 1

    def turned_away(self, name: str, counts: Mapping[str, int]) -> None:
        """Who else counts what names no topic: its counters, which are read whenever health is told."""
        self._turned_away[name] = counts

    def tick(self, t: int, stats: Stats) -> None:
        """Take what a monitor counted up to ``t`` (bus clock, ns); rates and latency are of the time since the last."""
        elapsed_s = 0.0 if self._ticked is None else (t - self._ticked) / 1e9
        self._topics = {name: self._topic(name, topic, t, elapsed_s) for name, topic in stats.topics.items()}
        self._seen = {name: topic.messages for name, topic in stats.topics.items()}
        self._drops = {str(reason): count for reason, count in stats.drops.items()}
        self._latency = _percentiles(sorted(self._latencies))
        self._latencies.clear()
        self._ticked = t

    def body(self) -> Health:
        """Nodes and filters now, topics and latency as of the last tick."""
        return Health(
            topics=self._topics,
            filters=self._filters,
            nodes=self._nodes,
            drops={**self._drops, **self._refused, **self._at_doors()},
            latency_ms=self._latency,
        )

    def _at_doors(self) -> dict[str, int]:
        return {
            f"{name}/{reason}": count
            for name, counts in self._turned_away.items()
            for reason, count in counts.items()
            if count
        }

    def _topic(self, name: str, stats: TopicStats, t: int, elapsed_s: float) -> TopicHealth:
        fresh = stats.messages - self._seen.get(name, 0)
        return TopicHealth(
            hz=fresh / elapsed_s if elapsed_s > 0.0 else 0.0,
            messages=stats.messages,
            gaps=min(stats.gaps, _MAX_COUNT),
            drops={str(reason): count for reason, count in stats.drops.items()},
            age=None if stats.last_arrival is None else max(t - stats.last_arrival, 0) / 1e9,
        )


async def publish_health(
    publisher: Publisher,
    board: HealthBoard,
    monitor: Subscriber,
    period_s: float = 1.0,
    clock: BusClock = now,
) -> None:
    """Count what ``monitor`` (all topics, EVERY) receives and publish until cancelled."""
    t = clock()
    board.tick(t, monitor.stats)
    due = t + int(period_s * 1e9)
    while True:
        monitor.drain()
        t = clock()
        if t >= due:
            due = t + int(period_s * 1e9)
            board.tick(t, monitor.stats)
            publisher.publish(SYSTEM, "health", t, board.body())
        await asyncio.sleep(0.0 if monitor.pending else min(_DRAIN_PERIOD_S, period_s))


def _percentiles(ordered_ns: list[int]) -> Latency | None:
    if not ordered_ns:
        return None
    # Nearest rank: a value that occurred, also with few samples.
    p50, p99 = (ordered_ns[math.ceil(share * len(ordered_ns)) - 1] / 1e6 for share in (0.50, 0.99))
    return Latency(p50=max(p50, 0.0), p99=max(p99, 0.0))
