"""Nothing published is lost to a slow start; what is lost later is counted."""

from __future__ import annotations

import asyncio
import gc
import random
import threading
import weakref
from collections.abc import Callable
from typing import Any

import pytest
from bus_traffic import BODY, publish, take

from foottrack_protocol import EncodeError, TopicError
from foottrack_protocol.messages import CameraPreview, GaitEvent
from foottrack_protocol.topics import Policy
from foottrack_service.bus import Broker, Bus, ManualClock, NotReady, Publisher, Received, Subscriber
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.subscriber import BATCH
from foottrack_service.config import BusSettings

EPHEMERAL = BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0")
Run = Callable[..., Any]


@pytest.mark.parametrize("seed", range(8))
def test_no_message_is_lost_whoever_starts_first(run: Run, context: Context, broker: Broker, seed: int) -> None:
    order = random.Random(seed)

    async def scenario() -> None:
        for turn in range(25):
            endpoints = [broker.endpoints, broker.inproc]
            made: dict[str, Any] = {}

            def start_publisher(made: dict[str, Any] = made, choices: Any = endpoints) -> None:
                made["publisher"] = Publisher(context, order.choice(choices).ingress, "test")

            def start_subscriber(made: dict[str, Any] = made, choices: Any = endpoints) -> None:
                made["subscriber"] = Subscriber(context, order.choice(choices).egress, ["user/truth/"])

            starts = [start_publisher, start_subscriber]
            order.shuffle(starts)
            for start in starts:
                start()
            publisher, subscriber = made["publisher"], made["subscriber"]
            waits = [publisher.ready(), subscriber.ready()]
            order.shuffle(waits)
            for wait in waits:
                await wait
            publish(publisher, 3)
            received = await take(subscriber, 3)
            assert [item.message.seq for item in received] == [0, 1, 2], turn
            assert publisher.drops == {}
            publisher.close()
            subscriber.close()

    run(scenario())


def test_greeting_proves_the_subscription_where_the_publisher_is_nearer_than_the_subscriber(
    broker: Broker, context: Context
) -> None:
    """The egress socket's own welcome alone loses about 1 in 600 of these."""
    publisher = Publisher(context, broker.inproc.ingress, "test")
    publisher.wait_ready()
    for turn in range(1_000):
        user = f"u{turn}"
        subscriber = Subscriber(context, broker.endpoints.egress, [f"{user}/"])
        subscriber.wait_ready()
        publisher.publish(user, "truth/left", 0, BODY)
        assert subscriber._socket.poll(2_000), f"lost in turn {turn}"
        subscriber.close()
    publisher.close()


def test_everybody_may_start_before_the_broker(run: Run, context: Context) -> None:
    with Broker(EPHEMERAL, context) as probe:
        settings = probe.endpoints
    bus = Bus.connect(settings, context)
    publisher, subscriber = bus.publisher("test"), bus.subscriber()

    async def scenario() -> None:
        waiting = asyncio.gather(publisher.ready(), subscriber.ready())
        with Broker(settings, context):
            await waiting
            publish(publisher, 10)
            assert [item.message.seq for item in await take(subscriber, 10)] == list(range(10))

    run(scenario())
    bus.close()


def test_without_a_bus_ready_ends_in_words(run: Run, context: Context) -> None:
    with Broker(EPHEMERAL, context) as probe:
        settings = probe.endpoints
    with Bus.connect(settings, context) as bus:
        publisher, subscriber = bus.publisher("test"), bus.subscriber()
        for wait in (publisher.ready, subscriber.ready):
            with pytest.raises(NotReady, match="is the service running"):
                run(wait(0.05))
        for wait_blocking in (publisher.wait_ready, subscriber.wait_ready):
            with pytest.raises(NotReady, match="is the service running"):
                wait_blocking(0.05)
        publish(publisher, 2)
        assert publisher.drops == {"no_bus": 2}
        assert publisher.sent == 0


def test_a_message_comes_out_as_it_went_in(run: Run, bus: Bus) -> None:
    clock = ManualClock(5_000)
    publisher = Publisher(bus.context, bus.settings.ingress, "fusion", clock)
    subscriber = Subscriber(bus.context, bus.settings.egress, [""], clock=clock)

    async def scenario() -> None:
        await publisher.ready()
        await subscriber.ready()
        event = GaitEvent(side="left", event="toe_off", step=3)
        sent = publisher.publish("user", "gait/event", 1_234, event, valid=False)
        assert (sent.t, sent.t_pub, sent.seq, sent.src, sent.valid) == (1_234, 5_000, 0, "fusion", False)
        assert publisher.publish("user", "gait/event", 1, event, t_pub=99).t_pub == 99
        clock.t = 7_000
        first, second = await take(subscriber, 2)
        assert first.message == sent
        assert first.arrival == 7_000
        assert second.message.seq == 1
        # What is sent as it is keeps its number and does not use one up.
        publisher.send(sent)
        publisher.send_frames(second.raw)
        publisher.publish("user", "gait/event", 2, event)
        again = await take(subscriber, 3)
        assert [item.message.seq for item in again] == [0, 1, 2]
        assert again[0].raw == first.raw

    run(scenario())
    publisher.close()
    subscriber.close()


def test_what_no_receiver_would_take_is_neither_sent_nor_numbered(bus: Bus) -> None:
    publisher = bus.publisher("camera")
    publisher.wait_ready()
    with pytest.raises(EncodeError, match="at most"):
        publisher.publish("user", "camera/preview", 0, CameraPreview(jpeg=bytes(300_000)))
    with pytest.raises(TopicError):
        publisher.publish("user", "camera/nothing", 0, CameraPreview(jpeg=b""))
    with pytest.raises(TopicError):
        publisher.publish("Not A User", "camera/preview", 0, CameraPreview(jpeg=b""))
    assert publisher.publish("user", "camera/preview", 0, CameraPreview(jpeg=b"")).seq == 0
    assert publisher.sent == 1


def test_a_subscription_is_a_prefix_and_seq_counts_per_topic(run: Run, bus: Bus) -> None:
    publisher, left, all_of_it = bus.publisher("test"), bus.subscriber(["user/truth/left"]), bus.subscriber()

    async def scenario() -> None:
        for part in (publisher, left, all_of_it):
            await part.ready()
        for _ in range(3):
            publish(publisher, 1, "truth/left")
            publish(publisher, 1, "truth/right")
        assert [item.message.topic for item in await take(left, 3)] == ["user/truth/left"] * 3
        assert sorted((item.message.stream, item.message.seq) for item in await take(all_of_it, 6)) == [
            (f"truth/{side}", seq) for side in ("left", "right") for seq in range(3)
        ]

    run(scenario())


def test_a_subscriber_to_all_that_leaves_takes_nothing_from_others(run: Run, bus: Bus) -> None:
    publisher, stays = bus.publisher("test"), bus.subscriber(["user/"])

    async def scenario() -> None:
        await publisher.ready()
        await stays.ready()
        for _ in range(5):
            leaves = bus.subscriber([""])
            await leaves.ready()
            leaves.close()
        publish(publisher, 4)
        assert len(await take(stays, 4)) == 4
        assert publisher.live

    run(scenario())


def test_latest_gives_the_newest_of_each_topic_and_counts_all(run: Run, bus: Bus) -> None:
    publisher = bus.publisher("test")
    latest, reference = bus.subscriber(policy=Policy.LATEST), bus.subscriber()
    count = 3 * BATCH + 7

    async def scenario() -> None:
        for part in (publisher, latest, reference):
            await part.ready()
        publish(publisher, count, "truth/right")
        publish(publisher, count, "truth/left")
        publish(publisher, 1, "truth/right")
        await take(reference, 2 * count + 1)
        newest = await take(latest, 2)
        # The reference came to its end, so all is in the latest's socket or on its last hop to it.
        while sum(topic.messages for topic in latest.stats.topics.values()) < 2 * count + 1:
            newest = await take(latest, 1)
        assert newest[-1].message.topic == "user/truth/right"
        assert newest[-1].message.seq == count
        assert [topic.gaps for topic in latest.stats.topics.values()] == [0, 0]

    run(scenario())


def test_latest_holds_one_message_per_topic_in_order_of_arrival(run: Run, bus: Bus) -> None:
    publisher, latest = bus.publisher("test"), bus.subscriber(policy=Policy.LATEST)

    async def scenario() -> None:
        await publisher.ready()
        await latest.ready()
        for stream in ("truth/left", "truth/right", "truth/left"):
            publish(publisher, 1, stream)
        seen: list[Received] = []
        while sum(topic.messages for topic in latest.stats.topics.values()) < 3:
            await latest._watch.readable()
            seen = _merge(seen, latest.drain())
        assert [(item.message.stream, item.message.seq) for item in seen] == [("truth/right", 0), ("truth/left", 1)]

    run(scenario())


def _merge(old: list[Received], new: list[Received]) -> list[Received]:
    topics = {item.raw[0] for item in new}
    assert len(topics) == len(new)
    return [item for item in old if item.raw[0] not in topics] + new


@pytest.mark.parametrize("way", ["tcp", "inproc"])
def test_a_stalled_subscriber_finds_a_gap_as_large_as_its_loss(
    run: Run, context: Context, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    # Over TCP the kernel holds tens of megabytes besides, as many as it likes: short queues of large messages make that
    # a small part of what is published.
    limit, total = 100, 2_000
    for room in ("broker", "subscriber"):
        monkeypatch.setattr(f"foottrack_service.bus.{room}.HWM", limit)
    broker = Broker(EPHEMERAL, context)
    broker.start()
    endpoints = broker.endpoints if way == "tcp" else broker.inproc
    publisher = Publisher(context, endpoints.ingress, "test")
    stalled = Subscriber(context, endpoints.egress, ["user/camera/"])
    reader = Subscriber(context, endpoints.egress, ["user/camera/"])
    body = CameraPreview(jpeg=bytes(100_000 if way == "tcp" else 1))
    chunk = limit // 2

    async def scenario() -> None:
        for part in (publisher, stalled, reader):
            await part.ready()
        for _ in range(total // chunk):
            for _ in range(chunk):
                publisher.publish("user", "camera/preview", 0, body)
            await take(reader, chunk)
        # What is published while the queues are still full may be lost too; one that arrives shows all losses before.
        kept: list[Received] = []
        published = total
        while not kept or kept[-1].message.seq != published - 1:
            publisher.publish("user", "camera/preview", 0, body)
            published += 1
            kept += await take(stalled, 1)

        stats = stalled.stats.topics["user/camera/preview"]
        assert publisher.drops == {}
        assert reader.stats.topics["user/camera/preview"].gaps == 0
        assert stats.gaps > 0
        assert len(kept) + stats.gaps == published
        assert stats.messages == len(kept)

    try:
        run(scenario())
    finally:
        for part in (publisher, stalled, reader):
            part.close()
        broker.stop()


def test_a_flood_starves_neither_the_loop_nor_another_subscriber(run: Run, bus: Bus) -> None:
    publisher, flooded, witness = (
        bus.publisher("test"),
        bus.subscriber(["user/truth/left"]),
        bus.subscriber(["user/truth/left"]),
    )
    other = bus.subscriber(["quiet/"])
    flood = 40 * BATCH

    async def scenario() -> None:
        # The other comes last: it sees greetings of those that come later, which are pending too.
        for part in (publisher, flooded, witness, other):
            await part.ready()
        publish(publisher, flood)
        await take(witness, flood)
        publisher.publish("quiet", "truth/left", 0, BODY)
        while not other.pending:
            await other._watch.readable()
        taken = turns = 0
        taken_before_other = -1

        async def read_flood() -> None:
            nonlocal taken
            async for _ in flooded:
                taken += 1
                if taken == flood:
                    return

        async def read_other() -> None:
            nonlocal taken_before_other
            await take(other, 1)
            taken_before_other = taken

        async def count_turns() -> None:
            nonlocal turns
            while taken < flood:
                turns += 1
                await asyncio.sleep(0)

        await asyncio.gather(read_flood(), read_other(), count_turns())
        # The last batch ends the reading: the turns are between the batches.
        assert turns >= flood // BATCH - 1
        assert taken_before_other <= BATCH

    run(scenario())


def test_readers_get_all_from_a_publisher_in_another_thread(run: Run, bus: Bus, context: Context) -> None:
    """The descriptor's edges: messages that arrive while the reader is between looking and waiting wake it too."""
    subscriber = bus.subscriber()
    count = 5_000

    def blast() -> None:
        publisher = Publisher(context, bus.settings.ingress, "thread")
        publisher.wait_ready()
        publish(publisher, count)
        publisher.close()

    async def scenario() -> None:
        await subscriber.ready()
        thread = threading.Thread(target=blast)
        thread.start()
        assert [item.message.seq for item in await take(subscriber, count)] == list(range(count))
        thread.join()

    run(scenario())


def test_closing_ends_the_iteration(run: Run, bus: Bus) -> None:
    subscriber = bus.subscriber()

    async def scenario() -> list[Received]:
        await subscriber.ready()
        asyncio.get_running_loop().call_soon(subscriber.close)
        return [item async for item in subscriber]

    assert run(scenario()) == []


def test_what_is_made_and_closed_for_days_is_forgotten(bus: Bus, run: Run) -> None:
    async def scenario() -> None:
        made: list[Any] = [bus.publisher("truth"), bus.subscriber(), bus.control()]
        remembered = [weakref.ref(each) for each in made]
        while made:
            made.pop().close()
        bus.publisher("truth").close()
        await asyncio.sleep(0)
        gc.collect()
        assert [each() for each in remembered] == [None, None, None]

    run(scenario())
