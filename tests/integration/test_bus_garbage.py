"""Whatever is thrown at the sockets, messages still pass, and what was refused is counted by reason."""

from __future__ import annotations

import logging
import random
import socket as network
from collections.abc import Callable
from typing import Any

import msgpack
import pytest
import zmq
from bus_traffic import BODY, take
from zmtp import RawSubscriber

from foottrack_service.bus import Bus, ManualClock, Received, Subscriber
from foottrack_service.bus.endpoints import MAX_FRAME_BYTES, Context

TOPIC = b"user/truth/left"
Run = Callable[..., Any]


def envelope(**changes: Any) -> bytes:
    values = {
        "v": 1,
        "src": "x",
        "sid": "x",
        "seq": 0,
        "t": 0,
        "t_pub": 0,
        "valid": True,
        "data": {"p": [0, 0, 0], "q": [0, 0, 0, 1]},
    }
    packed: bytes = msgpack.packb({**values, **changes})
    return packed


def nested(depth: int) -> Any:
    return [nested(depth - 1)] if depth else 0


GARBAGE: list[tuple[str, list[bytes]]] = [
    ("frames", [TOPIC]),
    ("frames", [TOPIC, envelope(), b"more"]),
    ("frames", [TOPIC, *([b""] * 100)]),
    ("topic", [b"user/no/such/stream", envelope()]),
    ("topic", [b"user/\xff\xfe", envelope()]),
    ("topic", [b"user/" + b"x" * 10_000, envelope()]),
    ("oversized", [TOPIC, bytes(300_000)]),
    ("msgpack", [TOPIC, b""]),
    ("msgpack", [TOPIC, b"\xc1"]),
    ("msgpack", [TOPIC, envelope()[:-3]]),
    ("envelope", [TOPIC, msgpack.packb([1, 2])]),
    ("envelope", [TOPIC, envelope(seq=-1)]),
    ("depth", [TOPIC, envelope(data=nested(20))]),
    ("version", [TOPIC, envelope(v=2)]),
    ("body", [TOPIC, envelope(data={"p": [0, 0]})]),
    ("not_finite", [TOPIC, envelope(data={"p": [float("nan"), 0, 0], "q": [0, 0, 0, 1]})]),
]
UNNAMED = {"frames", "topic"}
"""Reasons that leave no topic to count under."""


@pytest.fixture
def rogue(context: Context, bus: Bus) -> Any:
    """A publisher without manners."""
    made = context.socket(zmq.XPUB)
    made.connect(bus.settings.ingress)
    assert made.recv() == b"\x01"
    yield made
    made.close(0)


async def until(subscriber: Subscriber, src: str) -> list[Received]:
    received = []
    async for item in subscriber:
        received.append(item)
        if item.message.src == src:
            break
    return received


def test_garbage_is_counted_by_reason_and_logged_once_a_second(
    run: Run, bus: Bus, rogue: Any, caplog: pytest.LogCaptureFixture
) -> None:
    clock = ManualClock()
    subscriber = Subscriber(bus.context, bus.settings.egress, ["user/"], clock=clock)

    async def scenario() -> None:
        await subscriber.ready()
        # Each source is in order only with itself: the end mark comes through the rogue's own socket.
        for turn in range(2):
            for _, frames in GARBAGE:
                rogue.send_multipart(frames)
            rogue.send_multipart([TOPIC, envelope(src=f"mark{turn}")])
            assert [item.message.src for item in await until(subscriber, f"mark{turn}")] == [f"mark{turn}"]
            clock.advance(1_000_000_000)

    with caplog.at_level(logging.WARNING, "foottrack_service.bus"):
        run(scenario())
    expected = {reason: 2 * sum(1 for other, _ in GARBAGE if other == reason) for reason, _ in GARBAGE}
    named = {reason: count for reason, count in expected.items() if reason not in UNNAMED}
    assert subscriber.stats.drops == {reason: expected[reason] for reason in UNNAMED}
    assert subscriber.stats.topics[TOPIC.decode()].drops == named
    assert len(caplog.records) == 2
    assert "refused a message" in caplog.text
    subscriber.close()


def test_a_frame_beyond_all_measure_costs_its_sender_the_connection_and_nobody_else(
    run: Run, bus: Bus, rogue: Any
) -> None:
    subscriber, publisher = bus.subscriber(["user/"]), bus.publisher("good")

    async def scenario() -> None:
        await subscriber.ready()
        await publisher.ready()
        rogue.send_multipart([TOPIC, bytes(MAX_FRAME_BYTES + 1)])
        publisher.publish("user", "truth/left", 0, BODY)
        assert len(await until(subscriber, "good")) == 1

    run(scenario())
    assert subscriber.stats.drops == {}


@pytest.mark.parametrize("seed", range(3))
def test_bytes_that_are_not_zeromq_at_all_are_borne(run: Run, bus: Bus, seed: int) -> None:
    source = random.Random(seed)
    publisher, subscriber = bus.publisher("good"), bus.subscriber()
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL" + bytes(48)

    async def scenario() -> None:
        await publisher.ready()
        await subscriber.ready()
        for endpoint in (bus.settings.ingress, bus.settings.egress):
            port = int(endpoint.rpartition(":")[2])
            for start in (b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"", greeting, greeting[:11]):
                with network.create_connection(("127.0.0.1", port)) as connection:
                    connection.sendall(start + source.randbytes(500))
        publisher.publish("user", "truth/left", 0, BODY)
        assert len(await until(subscriber, "good")) == 1
        assert publisher.live

    run(scenario())


RUDE: list[list[bytes]] = [
    [b"\x00"],
    [b"\x00"] * 3,
    [b"\x01", b"\x00"],
    [b"\x00user/"],
    [b"user", b"\x00"],
    [b"user", b"\x01user/"],
    [b"x", b"\x01user/", b"y"],
    [b"\x01user/", b"\x01user/", b"x", b"\x01user/"],
    [b"\x01sys/welcome/x", b"x", b"\x00"],
    [b"", b""],
    [b"\x02ping"],
]


@pytest.mark.parametrize("rude", RUDE, ids=repr)
def test_a_subscriber_cannot_end_the_bus_for_others(run: Run, bus: Bus, rude: list[bytes]) -> None:
    """Frames that a subscriber sends reach the proxy's far side and all publishers: they must not pass for the bus
    going away, nor leave half a message that ends the proxy."""
    publisher, subscriber = bus.publisher("good"), bus.subscriber(["user/"])

    async def scenario() -> None:
        await publisher.ready()
        await subscriber.ready()
        with RawSubscriber(bus.settings.egress) as rogue:
            rogue.send(*rude)
            # Alone: a subscription right behind it would fill up half a message.
            for _ in range(50):
                publisher.publish("user", "truth/left", 0, BODY)
                assert len(await take(subscriber, 1)) == 1
            # What was sent is through the proxy and with the publishers when the greeter's answer is back.
            rogue.send(b"\x01sys/welcome/done")
            while rogue.receive() != b"sys/welcome/done":
                pass
            for _ in range(100):
                publisher.publish("user", "truth/left", 0, BODY)
            assert len(await take(subscriber, 100)) == 100
        late = bus.subscriber(["user/"])
        await late.ready()
        publisher.publish("user", "truth/left", 0, BODY)
        assert len(await take(late, 1)) == 1
        assert (publisher.connections, publisher.drops) == (1, {})

    run(scenario())
