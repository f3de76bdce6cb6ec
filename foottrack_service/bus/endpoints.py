"""Where sockets may be bound: in the clear on loopback only."""

from __future__ import annotations

import ipaddress
from typing import Any

import zmq

from foottrack_service.bus.errors import BindFailed, BindRefused

Context = zmq.Context[zmq.Socket[bytes]]
Socket = zmq.Socket[bytes]

HWM = 10_000
"""Messages that a socket holds in each direction: an overflow shows as a gap in ``seq``."""

MAX_FRAME_BYTES = 4 * 1024 * 1024
"""A peer that sends a larger frame is disconnected before the frame is held in memory. Well above what a receiver
refuses, so that a message that is merely oversized is still counted."""

_RELEASE_TIMEOUT_MS = 2_000


def check_loopback(endpoint: str) -> None:
    """Raises BindRefused unless the endpoint is reachable from this host alone."""
    transport, separator, address = endpoint.partition("://")
    if not separator:
        raise BindFailed(f"{endpoint!r} is no endpoint: it needs a transport, as in tcp://127.0.0.1:7701")
    if transport in ("inproc", "ipc"):
        return
    host = address.rpartition(":")[0].strip("[]")
    if transport != "tcp" or not _is_loopback(host):
        raise BindRefused(
            f"will not bind {endpoint}: whoever reaches the bus can read where a person's feet and head are and "
            "publish false poses, and connections there are neither encrypted nor authenticated. "
            "Use a loopback address, as in tcp://127.0.0.1:7701, and [bus.curve] listen for other hosts"
        )


def bind(socket: Socket, endpoint: str, encrypted: bool = False) -> str:
    """Bind, and say the actual endpoint (port 0 and ``*`` take a free one). Raises BindFailed.

    Raises BindRefused where others could reach it, unless the socket's connections are ``encrypted``.
    """
    if not encrypted:
        check_loopback(endpoint)
    if "[" in endpoint:
        socket.setsockopt(zmq.IPV6, 1)
    try:
        socket.bind(endpoint)
    except zmq.ZMQError as error:
        hint = ": is another foottrack running?" if error.errno == zmq.EADDRINUSE else ""
        raise BindFailed(f"cannot bind {endpoint}: {error}{hint}") from None
    actual: Any = socket.getsockopt(zmq.LAST_ENDPOINT)
    return str(actual.rstrip(b"\x00").decode())


def release(socket: Socket, *endpoints: str) -> None:
    """Unbind, and wait until the ports are free: libzmq closes them in a thread of its own."""
    bound = [endpoint for endpoint in endpoints if endpoint.startswith("tcp://")]
    if not bound:
        return
    monitor = socket.get_monitor_socket(zmq.EVENT_CLOSED)
    for endpoint in bound:
        socket.unbind(endpoint)
        if monitor.poll(_RELEASE_TIMEOUT_MS):
            monitor.recv_multipart()
    socket.disable_monitor()
    monitor.close(0)


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
