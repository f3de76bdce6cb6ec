"""Ports for services whose three sockets are in a row."""

from __future__ import annotations

import socket
from contextlib import ExitStack, suppress


def three_free_ports() -> int:
    """The first of three in a row."""
    while True:
        with ExitStack() as stack, suppress(OSError):
            first = stack.enter_context(socket.create_server(("127.0.0.1", 0))).getsockname()[1]
            for port in (first + 1, first + 2):
                stack.enter_context(socket.create_server(("127.0.0.1", port)))
            return int(first)
