"""The bus clock: this host's, or for a party on another host this host's and an offset (SPEC, section 3)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

BURST = 8
"""Requests in a burst."""
PERIOD_S = 2.0
"""From burst to burst."""
ANSWER_TIMEOUT_S = 0.5
_MAX_ROUND_TRIP_NS = 128_000_000
_MAX_DRIFT = 100e-6  # two crystals of 50 ppm each
_MAX_AGE_NS = 10_000_000_000


class Exchange(NamedTuple):
    """One request for the time: own clock before and after (ns), and what was answered (bus clock, ns)."""

    sent: int
    bus: int
    received: int


class _Offset(NamedTuple):
    value: int
    half_width: int
    at: int

    def bound(self, own: int) -> int:
        return self.half_width + int(abs(own - self.at) * _MAX_DRIFT)


class Clock:
    """Bus time, ns. On the service's host that is ``time.perf_counter_ns``; elsewhere bursts have to be fed in."""

    def __init__(self, same_host: bool = True, own: Callable[[], int] = time.perf_counter_ns) -> None:
        self.own = own
        self.same_host = same_host
        self._best: _Offset | None = None
        self._measured: int | None = None

    def __call__(self) -> int:
        """Bus time, ns; one's own time before the first burst."""
        return self.own() + (self.offset or 0)

    @property
    def offset(self) -> int | None:
        """Bus time minus own time, ns; None before the first burst on another host."""
        if self.same_host:
            return 0
        return None if self._best is None else self._best.value

    @property
    def uncertainty(self) -> int | None:
        """Half-width of the interval that holds the true offset now, ns."""
        if self.same_host:
            return 0
        return None if self._best is None else self._best.bound(self.own())

    @property
    def is_fresh(self) -> bool:
        """Whether stamps may be trusted: what is published otherwise is not valid."""
        return self.same_host or (self._measured is not None and self.own() - self._measured <= _MAX_AGE_NS)

    def forget(self) -> None:
        """The service is another one, and so may its clock be."""
        self._best = self._measured = None

    def on_burst(self, exchanges: Iterable[Exchange]) -> None:
        """Take the answers of a burst; of those only the one with the least round trip counts."""
        usable = [e for e in exchanges if 0 <= e.received - e.sent <= _MAX_ROUND_TRIP_NS]
        if not usable:
            return
        best = min(usable, key=lambda e: e.received - e.sent)
        middle = (best.sent + best.received) // 2
        found = _Offset(best.bus - middle, (best.received - best.sent + 1) // 2, middle)
        self._measured = middle
        before = self._best
        if (
            before is None
            or found.half_width <= before.bound(middle)
            or abs(found.value - before.value) > found.half_width + before.bound(middle)
        ):
            self._best = found
