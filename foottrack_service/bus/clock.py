"""The bus clock: nanoseconds of ``time.perf_counter_ns`` of the host that runs the service.

``perf_counter`` and not ``monotonic``: on Windows before Python 3.13 the latter ticks in 15.6 ms.
"""

from __future__ import annotations

import time
from typing import Protocol

now = time.perf_counter_ns
"""The bus clock of this host, ns: the same for all of its processes."""


class BusClock(Protocol):
    """Anything that says the bus time: ``now``, a ``ManualClock``, a ``SyncedClock``."""

    def __call__(self) -> int:
        """Bus time, ns."""


class ManualClock:
    """A clock that stands still until it is stepped."""

    def __init__(self, t: int = 0) -> None:
        self.t = t

    def __call__(self) -> int:
        return self.t

    def advance(self, ns: int) -> int:
        """Step forward, and say the new time, ns."""
        self.t += ns
        return self.t
