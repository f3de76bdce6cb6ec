"""The bus clock for a party on another host, or with a clock of its own (the method of liblsl's time_receiver).

Bursts of requests for ``time``; of each burst the answer with the least round trip counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.control import ControlClient

BURST = 8
"""Requests in a burst."""


class Exchange(NamedTuple):
    """One request: when it was sent and its answer received (own clock, ns), what the answer said (bus clock, ns)."""

    sent: int
    bus: int
    received: int


class SyncedClock:
    """A bus clock made of one's own clock and an offset that is measured now and then."""

    def __init__(self, clock: BusClock = now) -> None:
        self.offset: int | None = None

    def __call__(self) -> int:
        """Bus time, ns; one's own time before the first burst."""
        raise NotImplementedError

    @property
    def uncertainty(self) -> int | None:
        """Half-width of the interval that holds the true offset now, ns; grows with age. None before a burst."""
        raise NotImplementedError

    def fresh(self) -> bool:
        """Whether stamps may be trusted: False before the first burst and when the last one is too old."""
        raise NotImplementedError

    def to_bus(self, own: int) -> int:
        """An instant of one's own clock as bus time, ns."""
        raise NotImplementedError

    def on_burst(self, exchanges: Sequence[Exchange]) -> None:
        """Take the answers of a burst (those that came)."""


async def synchronise(clock: SyncedClock, client: ControlClient, period_s: float = 2.0) -> None:
    """Measure bursts until cancelled; a service that does not answer only lets the clock go stale."""
