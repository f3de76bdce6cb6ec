"""What a receiver counts: messages, gaps, refusals, arrivals."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from foottrack_protocol.envelope import Message
from foottrack_protocol.errors import DecodeError

MAX_TOPICS = 1_000
"""Topics that are counted one by one: a producer that makes up users must not fill the memory."""
MAX_RUNS = 4_096
"""Runs of publishers that are remembered; a forgotten one only misses its next gap."""


@dataclass(slots=True)
class TopicStats:
    """Of one topic, since the start."""

    messages: int = 0
    gaps: int = 0
    """Messages missed, by ``seq``; a new ``sid`` is not a gap, nor is a ``seq`` that goes back (a replay's loop)."""
    drops: Counter[str] = field(default_factory=Counter)
    """Refused messages by reason (foottrack_protocol.errors.Reason)."""
    last_arrival: int | None = None
    """Bus clock, ns, of the last message that was not refused."""


class Stats:
    """Of all topics that a subscriber saw. ``drops`` are refusals that name no topic, by reason."""

    def __init__(self) -> None:
        self.topics: dict[str, TopicStats] = {}
        self.drops: Counter[str] = Counter()
        self._last: dict[tuple[str, str, str], int] = {}

    def accept(self, message: Message, arrival: int) -> None:
        """Count a message."""
        topic = message.topic
        stats = self._of(topic)
        stats.messages += 1
        stats.last_arrival = arrival
        run = (topic, message.src, message.sid)
        last = self._last.get(run)
        if last is None:
            if len(self._last) >= MAX_RUNS:
                del self._last[next(iter(self._last))]
        elif message.seq > last + 1:
            stats.gaps += message.seq - last - 1
        self._last[run] = message.seq

    def refuse(self, error: DecodeError) -> None:
        """Count bytes that were no message."""
        drops = self.drops if error.topic is None else self._of(error.topic).drops
        drops[error.reason] += 1

    def _of(self, topic: str) -> TopicStats:
        stats = self.topics.get(topic)
        if stats is None:
            stats = TopicStats()
            if len(self.topics) < MAX_TOPICS:
                self.topics[topic] = stats
        return stats
