"""Connects again where libzmq does not, and knows why a connection does not come about.

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
LONGEST_PATIENCE_S = 2.0
"""Who is refused each time asks less and less often."""

_WATCHED = (
    zmq.EVENT_DISCONNECTED
    | zmq.EVENT_CONNECT_RETRIED
    | zmq.EVENT_HANDSHAKE_SUCCEEDED
    | zmq.EVENT_HANDSHAKE_FAILED_AUTH
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
)
# A peer of the other kind fails by protocol or without detail: it depends on who closes first.
_TROUBLE: dict[bool, dict[int, str]] = {
    True: {
        zmq.EVENT_HANDSHAKE_FAILED_AUTH: "the service does not know our key, or not for this role",
        zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL: "it does not speak CURVE: is that one of its encrypted ports?",
        zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL: "it breaks off: it has another key, or does not speak CURVE",
    },
    False: {
        zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL: "it takes encrypted connections only, or is no foottrack: give keys",
        zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL: "it takes encrypted connections only, or is no foottrack: give keys",
    },
}


class Revival:
    """Watches one connection of a socket. ``revived`` counts how often it had to be made anew."""

    def __init__(self, socket: zmq.Socket[Any], endpoint: str, encrypted: bool) -> None:
        self.revived = 0
        self._socket = socket
        self._endpoint = endpoint
        self._trouble = ""
        self._troubles = _TROUBLE[encrypted]
        self._patience_s = PATIENCE_S
        address = f"inproc://{uuid.uuid4().hex}"
        socket.monitor(address, _WATCHED)
        # Plain, also where the socket is an async one.
        self._monitor: zmq.Socket[bytes] = zmq.Context.shadow(socket.context.underlying).socket(zmq.PAIR)
        self._monitor.connect(address)
        self._lost_at: float | None = None

    @property
    def why_not(self) -> str:
        """Why no bus answers, for a person."""
        self.check()
        return f"no bus answers at {self._endpoint}: {self._trouble or 'is the service running?'}"

    def check(self) -> None:
        """To be called now and then, by the socket's thread."""
        while self._monitor.poll(0):
            event = parse_monitor_message(self._monitor.recv_multipart())["event"]
            if event == zmq.EVENT_HANDSHAKE_SUCCEEDED:
                self._patience_s = PATIENCE_S
                self._trouble = ""
            elif event in self._troubles:
                self._trouble = self._troubles[event]
            if event == zmq.EVENT_DISCONNECTED:
                self._lost_at = time.monotonic()
            elif event in (zmq.EVENT_CONNECT_RETRIED, zmq.EVENT_HANDSHAKE_SUCCEEDED):
                self._lost_at = None
        if self._lost_at is not None and time.monotonic() - self._lost_at > self._patience_s:
            self._lost_at = None
            self._patience_s = min(2.0 * self._patience_s, LONGEST_PATIENCE_S)
            self.revived += 1
            self._socket.disconnect(self._endpoint)
            self._socket.connect(self._endpoint)

    def close(self) -> None:
        """Before the socket is closed: a context does not end before its monitors."""
        if not self._socket.closed:
            self._socket.disable_monitor()
            self._monitor.close(0)
