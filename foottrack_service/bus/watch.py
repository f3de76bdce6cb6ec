"""Waiting on a ZeroMQ socket through its file descriptor, in any event loop that has ``add_reader``.

The descriptor is edge-triggered: it says that something happened, never what, and reading, sending or asking for the
socket's events takes the word back. So the events are asked after arming, after each word, and before each wait.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import zmq

from foottrack_service.bus.endpoints import Socket
from foottrack_service.bus.revival import Revival

# As ints: arithmetic with pyzmq's enums costs as much as the question itself.
_EVENTS = int(zmq.EVENTS)
_POLLIN = int(zmq.POLLIN)
_POLLOUT = int(zmq.POLLOUT)


class SocketWatch:
    """Wakes coroutines of one event loop when a socket can be read or written, and has its connection looked after."""

    def __init__(self, socket: Socket, revival: Revival | None = None) -> None:
        self._socket = socket
        self._revival = revival
        self._fd: int = socket.fileno()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiters: dict[asyncio.Future[None], int] = {}
        self._on_input: Callable[[], None] | None = None

    @property
    def has_input(self) -> bool:
        """Whether there is something to read now."""
        return self._events() & _POLLIN != 0

    async def readable(self) -> None:
        """Wait for something to read, or for ``close``. Always gives the event loop a turn."""
        await self._wait(_POLLIN)

    async def writable(self) -> None:
        """Wait until the socket takes a message, or for ``close``. Always gives the event loop a turn."""
        await self._wait(_POLLOUT)

    def call(self, on_input: Callable[[], None] | None) -> None:
        """Call this, instead of waking a coroutine, whenever there may be something to read; None ends that.

        It has to read until nothing is left.
        """
        self._on_input = on_input
        if on_input is not None:
            self._arm()
            on_input()

    def close(self) -> None:
        """Stop watching and wake all who wait; to be called before the socket is closed."""
        if self._on_input is not None and self._loop is not None:
            self._loop.call_soon(self._on_input)
        self._disarm()
        if self._revival is not None:
            self._revival.close()
        self._wake(_POLLIN | _POLLOUT)

    def _events(self) -> int:
        return 0 if self._socket.closed else int(self._socket.get(_EVENTS))

    async def _wait(self, wanted: int) -> None:
        loop = self._arm()
        if self._events() & wanted or self._socket.closed:
            await asyncio.sleep(0)
            return
        waiter = loop.create_future()
        self._waiters[waiter] = wanted
        try:
            await waiter
        finally:
            del self._waiters[waiter]

    def _arm(self) -> asyncio.AbstractEventLoop:
        loop = asyncio.get_running_loop()
        if self._loop is not loop and not self._socket.closed:
            self._disarm()
            loop.add_reader(self._fd, self._on_word)
            self._loop = loop
            if self._revival is not None:
                # Connecting anew takes words back, too.
                self._revival.attend(loop, self._on_word)
        return loop

    def _on_word(self) -> None:
        if self._on_input is not None:
            self._on_input()
            if not self._waiters:
                return
        # Also when nobody waits: asking takes the word back, and the loop would spin on it until somebody reads.
        self._wake(self._events())

    def _wake(self, events: int) -> None:
        for waiter, wanted in self._waiters.items():
            if events & wanted and not waiter.done():
                waiter.set_result(None)

    def _disarm(self) -> None:
        if self._revival is not None:
            self._revival.leave()
        if self._loop is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._fd)
        self._loop = None
