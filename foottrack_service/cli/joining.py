"""A command's way onto a service's bus, with that service's clock, wherever it runs."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING

from foottrack_service.config import Settings

if TYPE_CHECKING:
    from foottrack_service.bus.connection import Bus


@asynccontextmanager
async def joined(settings: Settings) -> AsyncIterator[Bus]:
    """The bus, its ``clock`` the service's: on another host (behind a relay, with keys) kept by asking for the time.

    Raises NotReady when no bus answers, ControlError when nobody tells the time.
    """
    from foottrack_service.bus.connection import Bus
    from foottrack_service.bus.timesync import SyncedClock, clock_of, synchronise

    with Bus.connect(settings.bus) as asking:
        await asking.subscriber(["sys/session"]).ready()
        clock = await clock_of(asking.control())
    with Bus.connect(settings.bus, clock=clock) as bus:
        if not isinstance(clock, SyncedClock):
            yield bus
            return
        keeping = asyncio.ensure_future(synchronise(clock, bus.control()))
        try:
            yield bus
        finally:
            keeping.cancel()
            await asyncio.gather(keeping, return_exceptions=True)
