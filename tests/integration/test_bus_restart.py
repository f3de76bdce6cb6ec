"""Publisher and broker die and come back while the others live; what was lost is counted."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bus_traffic import BODY, publish, take

from foottrack_service.bus import Broker, Bus, Received, Subscriber
from foottrack_service.bus.endpoints import Context
from foottrack_service.config import BusSettings

TOPIC = "user/truth/left"
ROOT = Path(__file__).parents[2]
Run = Callable[..., Any]

PROCESS = """
import itertools, sys, zmq
from foottrack_protocol.messages import Truth
from foottrack_service.bus import Publisher
publisher = Publisher(zmq.Context(), sys.argv[1], "lighthouse")
publisher.wait_ready()
body = Truth(p=(0.0, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0))
for _ in range(20):
    publisher.publish("user", "truth/left", 0, body)
publisher.close()
print("published", flush=True)
sys.stdin.readline()
"""


def start(ingress: str) -> subprocess.Popen[bytes]:
    """A publisher in a process of its own (not asyncio's: Windows' selector loop has no processes)."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "protocol")])}
    command = [sys.executable, "-c", PROCESS, ingress]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)


async def connected_again(subscriber: Subscriber) -> list[Received]:
    """What came until the bus was found a second time."""
    taken: list[Received] = []
    while subscriber.connections < 2:
        await subscriber._watch.readable()
        taken += subscriber.drain()
    return taken


def test_a_publisher_that_is_killed_and_restarted_leaves_no_false_gap(run: Run, bus: Bus) -> None:
    subscriber = bus.subscriber([TOPIC])

    async def scenario() -> list[Received]:
        await subscriber.ready()
        received = []
        for _ in range(2):
            process = start(bus.settings.ingress)
            received += await take(subscriber, 20)
            process.kill()
            process.communicate()
        return received

    received = run(scenario())
    sids = [item.message.sid for item in received]
    assert [item.message.seq for item in received] == [*range(20), *range(20)]
    assert len(set(sids[:20])) == len(set(sids[20:])) == 1
    assert sids[0] != sids[-1]
    stats = subscriber.stats.topics[TOPIC]
    assert (stats.messages, stats.gaps) == (40, 0)


def test_a_broker_that_restarts_is_found_again_and_the_loss_is_exact(run: Run, context: Context) -> None:
    first = Broker(BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0"), context)
    first.start()
    bus = Bus.connect(first.endpoints, context)
    publisher, subscriber = bus.publisher("test"), bus.subscriber(["user/"])

    async def scenario() -> None:
        await publisher.ready()
        await subscriber.ready()
        publish(publisher, 10)
        await take(subscriber, 10)
        first.stop()
        while publisher.live:
            await publisher._watch.readable()
        publish(publisher, 7)
        assert publisher.drops == {"no_bus": 7}
        with Broker(first.endpoints, context) as second:
            assert second.endpoints == first.endpoints
            await publisher.ready()
            # The subscriber finds the bus at its own pace: what is published meanwhile may be lost, and is counted.
            assert await connected_again(subscriber) == []
            publish(publisher, 5)
            assert [item.message.seq for item in await take(subscriber, 5)] == [17, 18, 19, 20, 21]
        assert publisher.connections == 2

    run(scenario())
    stats = subscriber.stats.topics[TOPIC]
    assert (stats.messages, stats.gaps) == (15, 7)
    assert publisher.sent == 15
    bus.close()


def test_what_is_published_while_the_broker_dies_is_received_or_counted(run: Run, context: Context) -> None:
    first = Broker(BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0"), context)
    first.start()
    bus = Bus.connect(first.endpoints, context)
    publisher, subscriber = bus.publisher("test"), bus.subscriber(["user/"])
    published = 0

    async def scenario() -> list[Received]:
        nonlocal published
        await publisher.ready()
        await subscriber.ready()
        publish(publisher, 1)
        received = await take(subscriber, 1)
        # Into the sockets that are about to go, some read and some not.
        publish(publisher, 2_000)
        first.stop()
        publish(publisher, 2_000)
        with Broker(first.endpoints, context):
            # A message before `ready` meets a bus that is going, gone or coming: received or counted all the same.
            publish(publisher, 10)
            await publisher.ready()
            received += await connected_again(subscriber)
            last = publisher.publish("user", "truth/left", 0, BODY)
            published = last.seq + 1
            async for item in subscriber:
                received.append(item)
                if item.message == last:
                    break
        return received

    received = run(scenario())
    stats = subscriber.stats.topics[TOPIC]
    assert published == 4_012
    assert len(received) == stats.messages
    assert stats.messages + stats.gaps == published
    assert publisher.sent + publisher.drops["no_bus"] + publisher.drops["full"] == published
    bus.close()


def test_a_broker_restarts_on_its_ports_at_once_many_times(run: Run, context: Context) -> None:
    settings = BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0")
    for _ in range(30):
        with Broker(settings, context) as broker:
            settings = broker.endpoints


def test_a_broker_with_a_context_of_its_own_ends_with_it() -> None:
    broker = Broker(BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0"))
    with broker:
        with Bus.connect(broker.endpoints) as bus:
            publisher, subscriber = bus.publisher("test"), bus.subscriber()
            publisher.wait_ready()
            subscriber.wait_ready()
        assert not broker.context.closed
    assert broker.context.closed
    broker.stop()
