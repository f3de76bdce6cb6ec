"""A server on plain sockets that speaks ZMTP 3.0 as SPEC has it, until a test makes it say something else."""

from __future__ import annotations

import socket
from collections.abc import Callable
from types import TracebackType
from typing import Self

from foottrack_client import Endpoints

TIMEOUT_S = 40.0
MORE, LONG, COMMAND = 1, 2, 4


def greeting(mechanism: bytes = b"NULL", major: int = 3) -> bytes:
    """The 64 bytes that begin a connection."""
    return b"\xff" + bytes(7) + b"\x01\x7f" + bytes([major, 0]) + mechanism.ljust(20, b"\0") + bytes(32)


def frame(content: bytes, flags: int = 0) -> bytes:
    """A frame's bytes."""
    if len(content) < 256:
        return bytes([flags, len(content)]) + content
    return bytes([flags | LONG]) + len(content).to_bytes(8, "big") + content


def message(*parts: bytes) -> bytes:
    """A message's bytes."""
    return b"".join(frame(part, MORE if n < len(parts) else 0) for n, part in enumerate(parts, 1))


def ready(socket_type: bytes) -> bytes:
    """READY with its Socket-Type."""
    return frame(b"\x05READY\x0bSocket-Type" + len(socket_type).to_bytes(4, "big") + socket_type, COMMAND)


class Peer:
    """One client's connection, seen from the server."""

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._socket.settimeout(TIMEOUT_S)

    def send(self, data: bytes) -> None:
        """Bytes as they are."""
        self._socket.sendall(data)

    def read(self, count: int) -> bytes:
        """So many bytes; fewer when the client hung up."""
        data = b""
        while len(data) < count:
            try:
                more = self._socket.recv(count - len(data))
            except ConnectionError:
                break
            if not more:
                break
            data += more
        return data

    def read_frame(self) -> tuple[int, bytes]:
        """Flags and content of the next frame."""
        flags = self.read(1)[0]
        length = int.from_bytes(self.read(8 if flags & LONG else 1), "big")
        return flags, self.read(length)

    def wait_closed(self) -> None:
        """Wait until the client hangs up, whatever it says before."""
        while self.read(4096):
            pass

    def shake_hands(self, socket_type: bytes) -> bytes:
        """Greeting and READY. Says the client's socket type."""
        self.send(greeting())
        assert self.read(64)[:1] == b"\xff"
        self.send(ready(socket_type))
        flags, content = self.read_frame()
        assert flags == COMMAND and content.startswith(b"\x05READY\x0bSocket-Type")
        return content[22:]

    def welcome(self) -> set[bytes]:
        """What the egress does until a subscriber is live. Says what it has subscribed to."""
        self.shake_hands(b"XPUB")
        self.send(message(b"sys/welcome"))
        prefixes: set[bytes] = set()
        while True:
            _, said = self.read_frame()
            if said.startswith(b"\x01sys/welcome/"):
                self.send(message(said[1:]))
                return prefixes
            prefixes.add(said[1:])

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


class FakeService:
    """Three listening sockets. A connection is taken when the test asks for it."""

    def __init__(self) -> None:
        self._listeners = [socket.create_server(("127.0.0.1", 0)) for _ in range(3)]
        self._peers: list[Peer] = []
        for listener in self._listeners:
            listener.settimeout(TIMEOUT_S)
        self.endpoints = Endpoints(*(f"tcp://127.0.0.1:{listener.getsockname()[1]}" for listener in self._listeners))

    def egress(self) -> Peer:
        """The next connection of a subscriber."""
        return self._accept(1)

    def live_egress(self) -> Peer:
        """A subscriber that is live."""
        peer = self.egress()
        peer.welcome()
        return peer

    def ingress(self) -> Peer:
        """The next connection of a publisher."""
        return self._accept(0)

    def control(self) -> Peer:
        """The next connection of somebody who asks."""
        return self._accept(2)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for peer in self._peers:
            peer.close()
        for listener in self._listeners:
            listener.close()

    def _accept(self, number: int) -> Peer:
        sock, _ = self._listeners[number].accept()
        peer = Peer(sock)
        self._peers.append(peer)
        return peer


def rude_greetings() -> dict[str, Callable[[Peer, bytes], None]]:
    """What a server may do to a client that ends the connection, by its name.

    They take the connection and the socket type that the client expects.
    """

    def after_hands(data: bytes) -> Callable[[Peer, bytes], None]:
        def act(peer: Peer, socket_type: bytes) -> None:
            peer.shake_hands(socket_type)
            peer.send(data)

        return act

    return {
        "another protocol": lambda peer, _: peer.send(b"HTTP/1.1 400 Bad Request\r\n\r\n" + bytes(64)),
        "nothing but 00": lambda peer, _: peer.send(bytes(200)),
        "ZMTP 2": lambda peer, _: peer.send(greeting(major=2)),
        "another mechanism": lambda peer, _: peer.send(greeting(b"CURVE")),
        "a message before READY": lambda peer, _: peer.send(greeting() + message(b"user/pose/body", b"\x80")),
        "the wrong socket": lambda peer, _: peer.send(greeting() + ready(b"PAIR")),
        "READY cut short": lambda peer, _: peer.send(
            greeting() + frame(b"\x05READY\x0bSocket-Type\0\0\0\x09XPUB", COMMAND)
        ),
        "flags that there are not": after_hands(b"\xf8\x01\x00"),
        "a frame of 2^63 bytes": after_hands(bytes([LONG]) + (1 << 63).to_bytes(8, "big")),
        "a frame of 1 GiB": after_hands(bytes([LONG]) + (1 << 30).to_bytes(8, "big")),
        "ERROR": after_hands(frame(b"\x05ERROR\x04away", COMMAND)),
    }
