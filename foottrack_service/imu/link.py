"""A serial device that may be unplugged: found, opened, watched, and found again."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

from foottrack_service.bus.clock import BusClock
from foottrack_service.imu import ports
from foottrack_service.imu.line import Line, OnData, OnLost, open_line

FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 2.0
WATCH_S = 0.5
"""Some adapters vanish without an error: so often we look whether the port is still there."""

TELL_S = 0.05
"""So often the device may be told something that only time brings on."""

Open = Callable[[str, int, OnData, OnLost, BusClock], Awaitable[Line]]

_log = logging.getLogger(__name__)


class SerialLink:
    """One device, over all its connections.

    ``connections`` and ``losses`` count, ``failure`` is why there is no connection now (None while there is one).
    """

    def __init__(
        self,
        name: str,
        find_port: Callable[[], str],
        baud: int,
        on_open: Callable[[], None],
        on_data: OnData,
        to_send: Callable[[float], list[bytes]],
        clock: BusClock,
        byte_gap_s: float = 0.0,
        on_state: Callable[[str | None], None] = lambda failure: None,
        open_: Open = open_line,
    ) -> None:
        """``find_port`` raises PortNotFound; ``to_send(now_s)`` says what the device is due; ``on_open`` comes before
        the first bytes of each connection; ``on_state`` gets each new ``failure``, and None when connected."""
        self.connections = 0
        self.losses = 0
        self.port: str | None = None
        self.failure: str | None = "not yet opened"
        self._name = name
        self._find_port = find_port
        self._baud = baud
        self._on_open = on_open
        self._on_data = on_data
        self._to_send = to_send
        self._clock = clock
        self._byte_gap_s = byte_gap_s
        self._on_state = on_state
        self._open = open_

    async def run(self) -> None:
        """Until cancelled."""
        pause = FIRST_PAUSE_S
        while True:
            try:
                port = await asyncio.to_thread(self._find_port)
                heard = await self._connection(port)
                pause = FIRST_PAUSE_S if heard else min(2.0 * pause, LONGEST_PAUSE_S)
            except (OSError, ports.PortNotFound) as error:
                self._failed(str(error))
                pause = min(2.0 * pause, LONGEST_PAUSE_S)
            await asyncio.sleep(pause)

    async def _connection(self, port: str) -> bool:
        """One connection; says whether anything was heard."""
        lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        heard = False

        def on_data(data: bytes, t_arr: int) -> None:
            nonlocal heard
            heard = True
            self._on_data(data, t_arr)

        def on_lost(reason: str) -> None:
            if not lost.done():
                lost.set_result(reason)

        self._on_open()
        line = await self._open(port, self._baud, on_data, on_lost, self._clock)
        self.connections += 1
        self.port, self.failure = port, None
        _log.info("%s: connected at %s", self._name, port)
        self._on_state(None)
        watching = asyncio.ensure_future(self._watch(port, on_lost))
        telling = asyncio.ensure_future(self._tell(line, on_lost))
        try:
            reason = await lost
        finally:
            watching.cancel()
            telling.cancel()
            await asyncio.gather(watching, telling, return_exceptions=True)
            await line.close()
            self.port = None
        self.losses += 1
        self._failed(f"{port} is gone: {reason}")
        return heard

    async def _watch(self, port: str, on_lost: OnLost) -> None:
        while True:
            try:
                there = await asyncio.to_thread(ports.exists, port)
            except OSError as error:
                on_lost(str(error))
                return
            if not there:
                on_lost("unplugged")
                return
            await asyncio.sleep(WATCH_S)

    async def _tell(self, line: Line, on_lost: OnLost) -> None:
        while True:
            for frame in self._to_send(self._clock() * 1e-9):
                try:
                    await self._write(line, frame)
                except OSError as error:
                    on_lost(str(error))
                    return
            await asyncio.sleep(TELL_S)

    async def _write(self, line: Line, frame: bytes) -> None:
        if self._byte_gap_s == 0.0:
            line.write(frame)
            return
        for at in range(len(frame)):
            line.write(frame[at : at + 1])
            await asyncio.sleep(self._byte_gap_s)

    def _failed(self, reason: str) -> None:
        if reason != self.failure:
            self.failure = reason
            _log.warning("%s: %s", self._name, reason)
            self._on_state(reason)
