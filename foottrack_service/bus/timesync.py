"""The bus clock for a party on another host, or with a clock of its own (the method of liblsl's time_receiver).

Bursts of requests for ``time``; of each burst the answer with the least round trip counts. It was read somewhere
between sending and receiving, so the midpoint is off by half the round trip at most. That bound grows with age by
what two clocks may drift apart, and a burst replaces the last one when it knows better.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from typing import NamedTuple

from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.control_client import ControlClient
from foottrack_service.bus.errors import ControlError, ControlTimeout

BURST = 8
"""Requests in a burst, as in liblsl."""
MAX_ROUND_TRIP_NS = 128_000_000
"""Slower answers do not count, as in liblsl."""
MAX_DRIFT = 100e-6
"""Two clocks with crystals of 50 ppm each."""
MAX_AGE_NS = 10_000_000_000
"""An offset that old is not fresh: five bursts were missed."""

FIRST_ANSWER_S = 2.0
"""A first answer waits for the connection, too."""

Ask = Callable[[], Awaitable[int]]
"""Asks the service for its time, ns."""


class Exchange(NamedTuple):
    """One request: when it was sent and its answer received (own clock, ns), what the answer said (bus clock, ns)."""

    sent: int
    bus: int
    received: int

    @property
    def round_trip(self) -> int:
        """ns."""
        return self.received - self.sent


class _Offset(NamedTuple):
    value: int
    half_width: int
    at: int

    def half_width_at(self, own: int) -> int:
        return self.half_width + int(abs(own - self.at) * MAX_DRIFT)


class SyncedClock:
    """A bus clock made of one's own clock and an offset that is measured now and then."""

    def __init__(self, clock: BusClock = now) -> None:
        self.own = clock
        self._best: _Offset | None = None
        self._measured: int | None = None

    def __call__(self) -> int:
        """Bus time, ns; one's own time before the first burst."""
        return self.to_bus(self.own())

    @property
    def offset(self) -> int | None:
        """Bus time minus own time, ns. None before the first burst."""
        return None if self._best is None else self._best.value

    @property
    def uncertainty(self) -> int | None:
        """Half-width of the interval that holds the true offset now, ns; grows with age. None before a burst."""
        return None if self._best is None else self._best.half_width_at(self.own())

    def fresh(self) -> bool:
        """Whether stamps may be trusted: False before the first burst and when the last one is too old."""
        return self._measured is not None and self.own() - self._measured <= MAX_AGE_NS

    def to_bus(self, own: int) -> int:
        """An instant of one's own clock as bus time, ns."""
        return own if self._best is None else own + self._best.value

    def on_burst(self, exchanges: Iterable[Exchange]) -> None:
        """Take the answers of a burst (those that came)."""
        usable = [exchange for exchange in exchanges if 0 <= exchange.round_trip <= MAX_ROUND_TRIP_NS]
        if not usable:
            return
        quickest = min(usable, key=lambda exchange: exchange.round_trip)
        middle = (quickest.sent + quickest.received) // 2
        found = _Offset(quickest.bus - middle, (quickest.round_trip + 1) // 2, middle)
        self._measured = middle
        if self._best is None or _knows_better(found, self._best):
            self._best = found


async def measure(ask: Ask, clock: BusClock = now, requests: int = BURST) -> list[Exchange]:
    """One burst. Ends early when an answer fails or does not come."""
    exchanges: list[Exchange] = []
    for _ in range(requests):
        sent = clock()
        try:
            bus = await ask()
        except ControlError:
            break
        exchanges.append(Exchange(sent, bus, clock()))
    return exchanges


async def clock_of(client: ControlClient) -> BusClock:
    """``now`` on the service's own host, else a ``SyncedClock`` that is fresh and wants ``synchronise``.

    Raises ControlError when the service does not answer.
    """
    clock = SyncedClock()
    await _ask_time(client, FIRST_ANSWER_S)
    clock.on_burst(await measure(lambda: _ask_time(client), clock.own))
    if clock.offset is None or clock.uncertainty is None:
        raise ControlTimeout("the service answers too slowly to tell its clock")
    # Two hosts whose clocks agree so well have been started in the same millisecond.
    return now if abs(clock.offset) <= clock.uncertainty else clock


async def synchronise(clock: SyncedClock, client: ControlClient, period_s: float = 2.0) -> None:
    """Measure bursts until cancelled; a service that does not answer only lets the clock go stale."""
    while True:
        clock.on_burst(await measure(lambda: _ask_time(client), clock.own))
        await asyncio.sleep(period_s)


async def _ask_time(client: ControlClient, timeout_s: float = 0.5) -> int:
    answer = await client.request("time", timeout_s=timeout_s)
    t = answer.get("t") if isinstance(answer, dict) else None
    if not isinstance(t, int):
        raise ControlError("bad_answer", "the answer to 'time' has no time")
    return t


def _knows_better(found: _Offset, best: _Offset) -> bool:
    before = best.half_width_at(found.at)
    if found.half_width <= before:
        return True
    # Two intervals that cannot both be right: a clock stood still (suspend) or the service is another one.
    return abs(found.value - best.value) > found.half_width + before
