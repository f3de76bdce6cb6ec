"""What a receiver counts: messages, gaps, refusals, arrivals."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(slots=True)
class TopicStats:
    """Of one topic, since the start."""

    messages: int = 0
    gaps: int = 0
    """Messages missed, by ``seq``; a new ``sid`` is not a gap."""
    drops: Counter[str] = field(default_factory=Counter)
    """Refused messages by reason (foottrack_protocol.errors.Reason)."""
    last_arrival: int | None = None
    """Bus clock, ns."""


class Stats:
    """Of all topics that a subscriber saw. ``drops`` are refusals that name no topic, by reason."""

    def __init__(self) -> None:
        self.topics: dict[str, TopicStats] = {}
        self.drops: Counter[str] = Counter()
