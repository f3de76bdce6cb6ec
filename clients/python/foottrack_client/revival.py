"""Connects again where libzmq does not.

libzmq gives a connection up for good when its peer breaks the protocol (zeromq/libzmq #4196), for example because some
other program was listening on the port for a while. Its monitor then reports the loss, and no new attempt.
"""

from __future__ import annotations

import time
import uuid
from typing import Any

import zmq
from zmq.utils.monitor import parse_monitor_message

PATIENCE_S = 0.5
"""A loss that is not followed by an attempt for so long is for good; libzmq's attempts are 0.1 s apart."""


class Revival:
    """Watches one connection of a socket. ``revived`` counts how often it had to be made anew."""

    def __init__(self, socket: zmq.Socket[Any], endpoint: str) -> None:
        self.revived = 0
        self._socket = socket
        self._endpoint = endpoint
        address = f"inproc://{uuid.uuid4().hex}"
        socket.monitor(address, zmq.EVENT_DISCONNECTED | zmq.EVENT_CONNECT_RETRIED)
        # Plain, also where the socket is an async one.
        self._monitor: zmq.Socket[bytes] = zmq.Context.shadow(socket.context.underlying).socket(zmq.PAIR)
        self._monitor.connect(address)
        self._lost_at: float | None = None

    def check(self) -> None:
        """To be called now and then, by the socket's thread."""
        while self._monitor.poll(0):
            event = parse_monitor_message(self._monitor.recv_multipart())
            self._lost_at = time.monotonic() if event["event"] == zmq.EVENT_DISCONNECTED else None
        if self._lost_at is not None and time.monotonic() - self._lost_at > PATIENCE_S:
            self._lost_at = None
            self.revived += 1
            self._socket.disconnect(self._endpoint)
            self._socket.connect(self._endpoint)

    def close(self) -> None:
        """Before the socket is closed: a context does not end before its monitors."""
        if not self._socket.closed:
            self._socket.disable_monitor()
            self._monitor.close(0)
