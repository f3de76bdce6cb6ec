"""An open serial line. Two ways to wait for its bytes, one interface."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol

import serial

from foottrack_service.bus.clock import BusClock

OnData = Callable[[bytes, int], None]
"""Bytes, and when they arrived (bus clock, ns); in the event loop."""

OnLost = Callable[[str], None]
"""The line is gone, and why; in the event loop, once, and not after ``close``."""

_READ_TIMEOUT_S = 0.2
_CLOSE_TIMEOUT_S = 2.0


class Line(Protocol):
    """What one can do with an open line."""

    def write(self, data: bytes) -> None:
        """Hand bytes to the driver."""

    async def close(self) -> None:
        """Let go of the port: afterwards it can be opened again."""


async def open_line(port: str, baud: int, on_data: OnData, on_lost: OnLost, clock: BusClock) -> Line:
    """Open a port, 8N1, for us alone. Raises OSError (serial.SerialException is one)."""
    if sys.platform == "win32":
        return await open_threaded(port, baud, on_data, on_lost, clock)
    return await open_asynchronous(port, baud, on_data, on_lost, clock)


async def open_asynchronous(port: str, baud: int, on_data: OnData, on_lost: OnLost, clock: BusClock) -> Line:
    """The event loop reads, where it can wait for a descriptor."""
    import serial_asyncio

    loop = asyncio.get_running_loop()
    device = await asyncio.to_thread(_open, port, baud, 0.0)
    reader = _Reader(on_data, on_lost, clock)
    return _AsynchronousLine(serial_asyncio.SerialTransport(loop, reader, device), reader)


async def open_threaded(port: str, baud: int, on_data: OnData, on_lost: OnLost, clock: BusClock) -> Line:
    """A thread reads, and stamps the arrival before the event loop has time."""
    device = await asyncio.to_thread(_open, port, baud, _READ_TIMEOUT_S)
    return _ThreadedLine(device, asyncio.get_running_loop(), on_data, on_lost, clock)


def _open(port: str, baud: int, timeout_s: float) -> Any:
    try:
        # Windows opens for one alone anyhow, and knows no flag for it.
        exclusive = None if sys.platform == "win32" else True
        device = serial.Serial(port, baud, timeout=timeout_s, write_timeout=1.0, exclusive=exclusive)
    except (OSError, ValueError) as error:
        text = str(error)
        raise OSError(text if port in text else f"{port}: {text}") from None
    # FTDI adapters hold bytes back for 16 ms unless told otherwise; others know no such mode.
    with suppress(OSError, ValueError, AttributeError, NotImplementedError):
        device.set_low_latency_mode(True)
    return device


class _Reader(asyncio.Protocol):
    def __init__(self, on_data: OnData, on_lost: OnLost, clock: BusClock) -> None:
        self.closing = False
        self.gone = asyncio.Event()
        self._on_data = on_data
        self._on_lost = on_lost
        self._clock = clock

    def data_received(self, data: bytes) -> None:
        if not self.closing:
            self._on_data(data, self._clock())

    def connection_lost(self, exc: Exception | None) -> None:
        self.gone.set()
        if not self.closing:
            self._on_lost(str(exc or "closed"))


class _AsynchronousLine:
    def __init__(self, transport: Any, reader: _Reader) -> None:
        self._transport = transport
        self._reader = reader

    def write(self, data: bytes) -> None:
        self._transport.write(data)

    async def close(self) -> None:
        self._reader.closing = True
        if not self._reader.gone.is_set():
            # Not close(): that waits until all is written, which a line that is gone never does.
            self._transport.abort()
            await self._reader.gone.wait()


class _ThreadedLine:
    def __init__(
        self, device: Any, loop: asyncio.AbstractEventLoop, on_data: OnData, on_lost: OnLost, clock: BusClock
    ) -> None:
        self._device = device
        self._loop = loop
        self._on_data = on_data
        self._on_lost = on_lost
        self._clock = clock
        self._closed = False
        self._thread = threading.Thread(target=self._read, name=f"serial {device.port}", daemon=True)
        self._thread.start()

    def write(self, data: bytes) -> None:
        # A line that is gone shows in the thread's next read.
        with suppress(OSError):
            self._device.write(data)

    async def close(self) -> None:
        self._closed = True
        with suppress(OSError, AttributeError):
            self._device.cancel_read()
        await asyncio.to_thread(self._thread.join, _CLOSE_TIMEOUT_S)
        self._device.close()

    def _read(self) -> None:
        while not self._closed:
            try:
                data = self._device.read(self._device.in_waiting or 1)
            # pyserial lets a TypeError through when the port is closed under it.
            except (OSError, TypeError) as error:
                self._tell(self._lost, str(error))
                return
            if data:
                self._tell(self._arrived, data, self._clock())

    def _tell(self, callback: Callable[..., None], *arguments: object) -> None:
        # The loop may have ended meanwhile.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(callback, *arguments)

    def _arrived(self, data: bytes, t_arr: int) -> None:
        if not self._closed:
            self._on_data(data, t_arr)

    def _lost(self, reason: str) -> None:
        if not self._closed:
            self._on_lost(reason)
