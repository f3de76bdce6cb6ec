"""Waiting on a ZeroMQ socket through its file descriptor, in any loop that has ``add_reader``.

The descriptor is edge-triggered: it says that something happened, never what, and reading, sending or asking for the
socket's events takes the word back. So the events are asked after arming, after each word, and before each wait.
"""

from __future__ import annotations

import asyncio

import zmq

from foottrack_service.bus.endpoints import Socket

# As ints: arithmetic with pyzmq's enums costs as much as the question itself.
_EVENTS = int(zmq.EVENTS)
_POLLIN = int(zmq.POLLIN)


class ReadWatch:
    """Wakes coroutines of one event loop when a socket has something to read."""

    def __init__(self, socket: Socket) -> None:
        self._socket = socket
        self._fd: int = socket.fileno()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiters: set[asyncio.Future[None]] = set()

    @property
    def has_input(self) -> bool:
        """Whether there is something to read now."""
        return not self._socket.closed and int(self._socket.get(_EVENTS)) & _POLLIN != 0

    async def readable(self) -> None:
        """Wait for something to read, or for ``close``. Always gives the event loop a turn."""
        loop = asyncio.get_running_loop()
        if self._loop is not loop:
            self._disarm()
            loop.add_reader(self._fd, self._on_word)
            self._loop = loop
        if self.has_input or self._socket.closed:
            await asyncio.sleep(0)
            return
        waiter = loop.create_future()
        self._waiters.add(waiter)
        try:
            await waiter
        finally:
            self._waiters.discard(waiter)

    def close(self) -> None:
        """Stop watching and wake all who wait; to be called before the socket is closed."""
        self._disarm()
        self._wake()

    def _on_word(self) -> None:
        if self.has_input:
            self._wake()

    def _wake(self) -> None:
        for waiter in self._waiters:
            if not waiter.done():
                waiter.set_result(None)

    def _disarm(self) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._fd)
        self._loop = None
