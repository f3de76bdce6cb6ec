"""A client that has nothing but a TCP socket and SPEC.md's "bytes of a connection"."""

from __future__ import annotations

import asyncio
import re
import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from foottrack_protocol import Message, decode, encode
from foottrack_protocol import messages as m
from foottrack_protocol.envelope import pack_map, unpack_map
from foottrack_protocol.generate import FOLDER
from foottrack_service.bus import Broker
from foottrack_service.bus.control import ControlServer
from foottrack_service.config import BusSettings

MORE, LONG, COMMAND = 1, 2, 4
MESSAGE = Message("user", "truth/left", "bare", "5d41402a", 0, 1, 2, True, m.Truth(p=(0, 1, 0), q=(0, 0, 0, 1)))


class BarePeer:
    """ZMTP 3.0 as the specification tells it."""

    def __init__(self, endpoint: str, kind: bytes) -> None:
        host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
        self._socket = socket.create_connection((host, int(port)), timeout=10)
        self._stream = self._socket.makefile("rb")
        self._socket.sendall(b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + b"\0" + bytes(31))
        greeting = self._stream.read(64)
        assert greeting[0] == 0xFF and greeting[9] == 0x7F and greeting[10] >= 3
        self.ready = b"\x05READY\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind
        self.send(self.ready, COMMAND)
        flags, ready = self._frame()
        assert flags & COMMAND and ready.startswith(b"\x05READY")

    def send(self, content: bytes, flags: int = 0) -> None:
        long = len(content) > 255
        size = len(content).to_bytes(8 if long else 1, "big")
        self._socket.sendall(bytes([flags | (LONG if long else 0)]) + size + content)

    def receive(self) -> list[bytes]:
        """The next message."""
        frames = []
        while True:
            flags, content = self._frame()
            if flags & COMMAND:
                assert not content.startswith(b"\x05ERROR"), content
                continue
            frames.append(content)
            if not flags & MORE:
                return frames

    def close(self) -> None:
        self._stream.close()
        self._socket.close()

    def _frame(self) -> tuple[int, bytes]:
        (flags,) = self._stream.read(1)
        size = int.from_bytes(self._stream.read(8 if flags & LONG else 1), "big")
        return flags, self._stream.read(size)


@pytest.fixture
def broker() -> Iterator[Broker]:
    with Broker(BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0")) as running:
        yield running


@pytest.fixture
def peers() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def subscribed(peer: BarePeer, *prefixes: bytes) -> None:
    """Subscribe, and wait until it is in force."""
    for prefix in (b"sys/welcome", *prefixes):
        peer.send(b"\x01" + prefix)
    token = b"sys/welcome/" + b"0123456789abcdef" * 2
    peer.send(b"\x01" + token)
    while peer.receive() != [token]:
        pass


def test_the_example_of_ready_is_right(broker: Broker, peers: ExitStack) -> None:
    peer = BarePeer(broker.endpoints.egress, b"SUB")
    peers.callback(peer.close)
    spec = (FOLDER / "SPEC.md").read_text(encoding="utf-8")
    assert (bytes([COMMAND, len(peer.ready)]) + peer.ready).hex(" ") in re.sub(r"\s+", " ", spec)


def test_nothing_is_lost_between_two_bare_sockets(broker: Broker, peers: ExitStack) -> None:
    subscriber = BarePeer(broker.endpoints.egress, b"SUB")
    peers.callback(subscriber.close)
    subscribed(subscriber, b"user/truth/")
    publisher = BarePeer(broker.endpoints.ingress, b"XPUB")
    peers.callback(publisher.close)
    assert publisher.receive() == [b"\x01"]
    messages = [MESSAGE._replace(seq=seq, src="x" * (1 + 300 * (seq % 2))) for seq in range(20)]
    for message in messages:
        topic, payload = encode(message)
        publisher.send(topic, MORE)
        publisher.send(payload)
    assert [decode(subscriber.receive()) for _ in messages] == messages


def test_the_bus_that_goes_away_says_so(broker: Broker, peers: ExitStack) -> None:
    publisher = BarePeer(broker.endpoints.ingress, b"XPUB")
    peers.callback(publisher.close)
    assert publisher.receive() == [b"\x01"]
    broker.stop()
    with pytest.raises((ValueError, OSError)):
        publisher.receive()


@pytest.mark.parametrize("numbered", [False, True])
def test_a_bare_dealer_gets_its_answer(broker: Broker, peers: ExitStack, run: object, numbered: bool) -> None:
    server = ControlServer(broker.context, "tcp://127.0.0.1:0", {})
    peers.callback(server.close)
    peer = BarePeer(server.endpoint, b"DEALER")
    peers.callback(peer.close)
    route = [b"7", b""] if numbered else [b""]
    for frame in route:
        peer.send(frame, MORE)
    peer.send(pack_map({"cmd": "time"}))

    async def serve() -> list[bytes]:
        serving = asyncio.create_task(server.run())
        answer = await asyncio.to_thread(peer.receive)
        server.close()
        await serving
        return answer

    *returned, answer = run(serve())  # type: ignore[operator]
    assert returned == route
    assert list(unpack_map(answer)["result"]) == ["t"]
