"""Where a service listens, and sockets that go there as the specification wants them."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import zmq

from foottrack_client.keys import Keys

HWM = 10_000
"""Messages that a socket holds; what does not fit shows as a gap in ``seq``."""
MAX_FRAME_BYTES = 4 * 1024 * 1024
HEARTBEAT_MS = 1_000
HEARTBEAT_TIMEOUT_MS = 5_000


class Endpoints(NamedTuple):
    """The three sockets of a service; the defaults are those of a service on this host."""

    ingress: str = "tcp://127.0.0.1:7701"
    egress: str = "tcp://127.0.0.1:7702"
    control: str = "tcp://127.0.0.1:7703"

    @classmethod
    def beginning_at(cls, first: str) -> Self:
        """``tcp://host:port`` and the two ports after it. Raises ValueError."""
        head, _, port = first.rpartition(":")
        if not head.startswith("tcp://") or not port.isdecimal() or not 0 < int(port) <= 65533:
            raise ValueError(f"{first!r} is no endpoint with a port, such as tcp://127.0.0.1:7701")
        return cls(*(f"{head}:{int(port) + n}" for n in range(3)))


def set_up(socket: zmq.Socket[Any], endpoint: str, keys: Keys | None) -> None:
    """Limits and options that all our sockets have; to be called before connecting."""
    if keys is not None:
        socket.curve_publickey = keys.public.encode()
        socket.curve_secretkey = keys.secret.encode()
        socket.curve_serverkey = keys.service.encode()
        # A host that is switched off says no goodbye.
        socket.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
        socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    socket.set_hwm(HWM)
    socket.setsockopt(zmq.MAXMSGSIZE, MAX_FRAME_BYTES)
    socket.setsockopt(zmq.LINGER, 0)
    if "[" in endpoint:
        socket.setsockopt(zmq.IPV6, 1)
