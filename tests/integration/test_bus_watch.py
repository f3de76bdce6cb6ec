"""How the event loop learns of messages: no spinning, no lost edge, callbacks that share it."""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from bus_traffic import BODY, publish, take

from foottrack_service.bus import Bus, Publisher, Received
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.subscriber import BATCH
from foottrack_service.bus.watch import SocketWatch

Run = Callable[..., Any]


def test_unread_messages_do_not_make_the_loop_spin(run: Run, bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    words: Counter[SocketWatch] = Counter()
    inner = SocketWatch._on_word

    def counting(watch: SocketWatch) -> None:
        words[watch] += 1
        inner(watch)

    monkeypatch.setattr(SocketWatch, "_on_word", counting)
    publisher, held_up, reader = bus.publisher("test"), bus.subscriber(["user/"]), bus.subscriber(["user/"])
    busy = asyncio.Event()

    async def consume() -> None:
        async for _ in held_up:
            busy.set()
            await asyncio.Event().wait()

    async def scenario() -> int:
        for part in (publisher, held_up, reader):
            await part.ready()
        consumer = asyncio.create_task(consume())
        await asyncio.sleep(0)
        publish(publisher, 1)
        await busy.wait()
        before = words[held_up._watch]
        publish(publisher, 10)
        await take(reader, 11)
        # To ask whether messages wait would already take the word back.
        while words[held_up._watch] == before:  # noqa: ASYNC110
            await asyncio.sleep(0)
        for _ in range(500):
            await asyncio.sleep(0)
        consumer.cancel()
        return words[held_up._watch] - before

    # Each message may bring a word or two; a spinning loop has one in each of its turns.
    assert run(scenario()) < 50


def test_deliver_hands_over_all_in_order_from_another_thread(run: Run, bus: Bus, context: Context) -> None:
    subscriber = bus.subscriber(["user/"])
    count = 5_000
    seqs: list[int] = []

    def blast() -> None:
        publisher = Publisher(context, bus.settings.ingress, "thread")
        publisher.wait_ready()
        publish(publisher, count)
        publisher.close()

    def handle(batch: list[Received]) -> None:
        assert 0 < len(batch) <= BATCH
        seqs.extend(item.message.seq for item in batch)
        if len(seqs) == count:
            subscriber.close()

    async def scenario() -> None:
        await subscriber.ready()
        thread = threading.Thread(target=blast)
        thread.start()
        await subscriber.deliver(handle)
        thread.join()

    run(scenario())
    assert seqs == list(range(count))


def test_deliver_gives_other_callbacks_their_turn(run: Run, bus: Bus) -> None:
    publisher, flooded, witness = bus.publisher("test"), bus.subscriber(["user/"]), bus.subscriber(["user/"])
    flood = 40 * BATCH
    taken = turns = 0

    def handle(batch: list[Received]) -> None:
        nonlocal taken
        taken += len(batch)
        if taken == flood:
            flooded.close()

    async def scenario() -> None:
        nonlocal turns
        for part in (publisher, flooded, witness):
            await part.ready()
        publish(publisher, flood)
        await take(witness, flood)
        delivery = asyncio.create_task(flooded.deliver(handle))
        while not delivery.done():
            turns += 1
            await asyncio.sleep(0)
        await delivery

    run(scenario())
    assert taken == flood
    assert turns >= flood // BATCH - 1


def test_an_error_of_the_handler_ends_the_delivery_and_nothing_else(run: Run, bus: Bus) -> None:
    publisher, subscriber = bus.publisher("test"), bus.subscriber(["user/"])

    def handle(batch: list[Received]) -> None:
        raise ValueError("cannot use that")

    async def scenario() -> None:
        await publisher.ready()
        await subscriber.ready()
        publisher.publish("user", "truth/left", 0, BODY)
        with pytest.raises(ValueError, match="cannot use that"):
            await subscriber.deliver(handle)
        publisher.publish("user", "truth/left", 0, BODY)
        assert [item.message.seq for item in await take(subscriber, 1)] == [1]

    run(scenario())
