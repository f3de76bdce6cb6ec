"""Connects again where libzmq does not.

libzmq gives a connection up for good when its peer breaks the protocol (zeromq/libzmq #4196): some other program
listened on the port for a while, or a key was not on the list yet. Its monitor then reports the loss, and no new try.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Callable

import zmq
from zmq.utils.monitor import parse_monitor_message

from foottrack_service.bus.endpoints import Context, Socket

FIRST_PATIENCE_S = 0.5
"""A loss that is not followed by an attempt for so long is for good: libzmq announces its own attempts at once."""
LONGEST_PATIENCE_S = 2.0
"""Who is refused each time asks less and less often."""

_WATCHED = zmq.EVENT_DISCONNECTED | zmq.EVENT_CONNECT_RETRIED | zmq.EVENT_HANDSHAKE_SUCCEEDED


class Revival:
    """Watches one connection of a socket. ``revived`` counts how often it had to be made anew.

    ``attend`` makes an event loop do all of it; without one, ``check`` has to be called now and then. Belongs to the
    socket's thread, or, where ``reconnect`` does not touch the socket, to any one.
    """

    def __init__(
        self, context: Context, socket: Socket, endpoint: str, reconnect: Callable[[], None] | None = None
    ) -> None:
        """Before the socket is connected. inproc endpoints need no watching."""
        self.revived = 0
        self._socket = socket
        self._endpoint = endpoint
        self._reconnect = reconnect or self._connect_anew
        self._loop: asyncio.AbstractEventLoop | None = None
        self._on_revived: Callable[[], None] | None = None
        self._lost_at: float | None = None
        self._patience_s = FIRST_PATIENCE_S
        self._monitor: Socket | None = None
        if endpoint.startswith("tcp://"):
            address = f"inproc://{uuid.uuid4().hex}"
            socket.monitor(address, _WATCHED)
            self._monitor = context.socket(zmq.PAIR)
            self._monitor.connect(address)

    def check(self) -> None:
        """See how the connection is, and make it anew when it is lost for good. Never waits."""
        if self._monitor is None:
            return
        while self._monitor.poll(0):
            event = parse_monitor_message(self._monitor.recv_multipart(zmq.NOBLOCK))["event"]
            self._lost_at = time.monotonic() if event == zmq.EVENT_DISCONNECTED else None
            if event == zmq.EVENT_HANDSHAKE_SUCCEEDED:
                self._patience_s = FIRST_PATIENCE_S
        if self._lost_at is None or time.monotonic() - self._lost_at < self._patience_s:
            return
        self._lost_at = None
        self._patience_s = min(2.0 * self._patience_s, LONGEST_PATIENCE_S)
        self.revived += 1
        self._reconnect()
        if self._on_revived is not None:
            self._on_revived()

    def poll(self, timeout_ms: int) -> bool:
        """Wait for something to read from the socket, and look after the connection meanwhile."""
        slice_ms = int(FIRST_PATIENCE_S * 1000)
        while not self._socket.poll(min(timeout_ms, slice_ms)):
            self.check()
            timeout_ms -= slice_ms
            if timeout_ms <= 0:
                return False
        return True

    def attend(self, loop: asyncio.AbstractEventLoop, on_revived: Callable[[], None] | None = None) -> None:
        """Look after the connection whenever something happens to it. ``on_revived``: to be called afterwards."""
        self.leave()
        if self._monitor is not None:
            self._loop, self._on_revived = loop, on_revived
            loop.add_reader(self._monitor.fileno(), self._look)
            self._look()

    def leave(self) -> None:
        """Stop attending."""
        if self._loop is not None and self._monitor is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._monitor.fileno())
        self._loop = self._on_revived = None

    def close(self) -> None:
        """Before the socket is closed: a context does not end before its monitors."""
        self.leave()
        if self._monitor is not None:
            self._socket.disable_monitor()
            self._monitor.close(0)
            self._monitor = None

    def _look(self) -> None:
        self.check()
        if self._loop is not None and self._lost_at is not None:
            self._loop.call_later(self._patience_s, self._look)

    def _connect_anew(self) -> None:
        self._socket.disconnect(self._endpoint)
        self._socket.connect(self._endpoint)
