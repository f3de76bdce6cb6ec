"""The real service in a thread of its own, which can be restarted on its ports."""

from __future__ import annotations

import asyncio
import threading
from types import TracebackType
from typing import Self

from foottrack_client import Endpoints
from foottrack_service.app import Service
from foottrack_service.config import BusSettings, Settings
from foottrack_service.curve_settings import CurveSettings

START_TIMEOUT_S = 20.0


class LiveService:
    """Bus, control socket and system topics; no nodes, so that each message comes from the test."""

    def __init__(self, curve: CurveSettings | None = None) -> None:
        """``curve``: with encrypted endpoints, which are ``encrypted`` then."""
        self.endpoints = Endpoints(*["tcp://127.0.0.1:0"] * 3)
        self._curve = curve or CurveSettings()

    def start(self) -> None:
        """Run on the ports of last time."""
        self._started = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)
        self._thread.start()
        assert self._started.wait(START_TIMEOUT_S), "the service did not start"

    def stop(self) -> None:
        """When this returns, the ports are free."""
        self._loop.call_soon_threadsafe(self._ending.set)
        self._thread.join(START_TIMEOUT_S)
        assert not self._thread.is_alive(), "the service did not stop"

    def restart(self) -> None:
        """Another run of the service, with another session."""
        self.stop()
        self.start()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._thread.is_alive():
            self.stop()

    async def _run(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._ending = asyncio.Event()
        settings = Settings(bus=BusSettings(**self.endpoints._asdict(), curve=self._curve))
        async with Service(settings) as service:
            bus = service.endpoints
            self.endpoints = Endpoints(bus.ingress, bus.egress, bus.control)
            ends = service.encrypted_endpoints
            if ends:
                self.encrypted = Endpoints(ends["publish"], ends["subscribe"], ends["control"])
            self._started.set()
            await self._ending.wait()
