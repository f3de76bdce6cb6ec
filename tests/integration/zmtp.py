"""A subscriber that speaks ZMTP 3.0 on a plain TCP socket, and says what no library would."""

from __future__ import annotations

import socket
from types import TracebackType
from typing import Self

GREETING = b"\xff" + bytes(7) + b"\x01\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
READY = b"\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB"


class RawSubscriber:
    """Connected and greeted when it is made."""

    def __init__(self, endpoint: str) -> None:
        self._socket = socket.create_connection(("127.0.0.1", int(endpoint.rpartition(":")[2])))
        self._socket.sendall(GREETING)
        self._receive(len(GREETING))
        self._socket.sendall(bytes([4, len(READY)]) + READY)
        self._receive(self._receive(2)[1])

    def send(self, *parts: bytes) -> None:
        """One message of short parts."""
        for number, part in enumerate(parts, 1):
            self._socket.sendall(bytes([number < len(parts), len(part)]) + part)

    def receive(self) -> bytes:
        """The next short frame."""
        return self._receive(self._receive(2)[1])

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    def _receive(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            more = self._socket.recv(count - len(data))
            assert more, "the peer hung up"
            data += more
        return data
