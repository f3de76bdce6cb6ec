"""``sys/session``, ``sys/health``, ``sys/log`` and the connection that nodes get."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from bus_traffic import BODY, take

from foottrack_service.bus import Broker, Bus, ManualClock, Received
from foottrack_service.bus.health import publish_health
from foottrack_service.bus.log import BusLogHandler
from foottrack_service.bus.session import SessionInfo, publish_session
from foottrack_service.bus.timesync import Exchange, SyncedClock

Run = Callable[..., Any]


async def beside(work: Any, scenario: Any) -> Any:
    """A scenario while some endless work runs."""
    task = asyncio.create_task(work)
    try:
        return await scenario
    finally:
        task.cancel()
        assert isinstance((await asyncio.gather(task, return_exceptions=True))[0], asyncio.CancelledError)


def test_the_session_is_published_with_the_same_instant_on_both_clocks(run: Run, bus: Bus) -> None:
    publisher, subscriber = bus.publisher("service"), bus.subscriber(["sys/session"])
    info = SessionInfo(users=["user", "guest"], config_hash="abc")

    async def scenario() -> list[Received]:
        await publisher.ready()
        await subscriber.ready()
        before = time.perf_counter_ns(), time.time_ns()
        received: list[Received] = await beside(publish_session(publisher, info, period_s=0.01), take(subscriber, 3))
        after = time.perf_counter_ns(), time.time_ns()
        for item in received:
            anchor = item.message.data.clock
            assert before[0] <= anchor.bus <= after[0]
            assert before[1] <= anchor.unix <= after[1]
        return received

    received = run(scenario())
    assert {item.message.data.session for item in received} == {info.session}
    assert received[0].message.data.users == ["user", "guest"]
    assert SessionInfo().session != info.session


def test_health_tells_what_passed_and_what_was_refused(run: Run, bus: Bus) -> None:
    publisher, subscriber = bus.publisher("service"), bus.subscriber(["sys/health"])
    monitor = bus.subscriber()

    async def scenario() -> Any:
        for part in (publisher, subscriber, monitor):
            await part.ready()
        bus.health.node("camera", "failed", "no device")
        bus.health.filter("user/left", {"imu": 5}, {"gate": 2})
        bus.health.latency(2_000_000)
        for seq in (0, 1, 2, 5):
            message = publisher.publish("user", "truth/left", 0, BODY)
            publisher.send(message._replace(sid="other", seq=seq))
        publisher.send_frames((b"user/truth/left", b"\xc1"))
        publisher.send_frames((b"who/knows", b""))

        async def first_with_all() -> Any:
            async for item in subscriber:
                if item.message.data.topics.get("user/truth/left"):
                    return item.message.data
            return None

        return await beside(publish_health(publisher, bus.health, monitor, period_s=0.02), first_with_all())

    health = run(scenario())
    topic = health.topics["user/truth/left"]
    assert (topic.messages, topic.gaps, topic.drops) == (8, 2, {"msgpack": 1})
    assert topic.hz > 0
    assert topic.age is not None
    assert health.drops == {"topic": 1}
    assert health.nodes["camera"].error == "no device"
    assert health.filters["user/left"].rejected == {"gate": 2}


def test_health_goes_on_while_messages_never_stop(run: Run, bus: Bus) -> None:
    publisher, subscriber, monitor = bus.publisher("service"), bus.subscriber(["sys/health"]), bus.subscriber()

    async def flood() -> None:
        while True:
            for _ in range(100):
                publisher.publish("user", "truth/left", 0, BODY)
            await asyncio.sleep(0)

    async def scenario() -> list[Received]:
        for part in (publisher, subscriber, monitor):
            await part.ready()
        reports = take(subscriber, 3)
        health = publish_health(publisher, bus.health, monitor, period_s=0.02)
        received: list[Received] = await beside(flood(), beside(health, reports))
        return received

    counts = [item.message.data.topics["user/truth/left"].messages for item in run(scenario())]
    assert counts == sorted(set(counts))


@pytest.fixture
def logger() -> Any:
    made = logging.getLogger("foottrack_service.bus.test")
    made.propagate = False
    yield made
    made.handlers.clear()


def test_warnings_of_all_threads_come_to_the_bus_and_less_does_not(run: Run, bus: Bus, logger: Any) -> None:
    publisher, subscriber = bus.publisher("service"), bus.subscriber(["sys/log"])

    async def scenario() -> list[Received]:
        await publisher.ready()
        await subscriber.ready()
        logger.addHandler(BusLogHandler(publisher))
        logger.info("not this one")
        logger.warning("foot %s is %s", "left", "lost")
        try:
            raise OSError("unplugged")
        except OSError:
            logger.exception("imu")
        logger.warning("a lone \ud800 surrogate and %s", "x" * 10_000)
        logger.critical("%d", "not a number")
        thread = threading.Thread(target=logger.critical, args=("from a thread",))
        thread.start()
        thread.join()
        return await take(subscriber, 4)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(logging, "raiseExceptions", False)
        bodies = [item.message.data for item in run(scenario())]
    assert [(body.level, body.message) for body in bodies if len(body.message) < 100] == [
        ("warning", "foot left is lost"),
        ("error", "imu: OSError: unplugged"),
        ("critical", "from a thread"),
    ]
    assert bodies[2].message.startswith("a lone ? surrogate and xxx")
    assert len(bodies[2].message) == 4_000


def record(second: float, text: str) -> logging.LogRecord:
    made = logging.LogRecord("x", logging.WARNING, "x.py", 1, text, None, None)
    made.created = second
    return made


def test_a_flood_of_log_records_is_held_back_and_counted(run: Run, bus: Bus) -> None:
    publisher, subscriber = bus.publisher("service"), bus.subscriber(["sys/log"])

    async def scenario() -> list[str]:
        await publisher.ready()
        await subscriber.ready()
        handler = BusLogHandler(publisher, per_second=2)
        for number in range(10):
            handler.handle(record(100.0 + number / 10, f"r{number}"))
        handler.handle(record(101.0, "next second"))
        handler.handle(record(101.1, "and on"))
        return [item.message.data.message for item in await take(subscriber, 4)]

    assert run(scenario()) == ["r0", "r1", "next second (8 more were held back)", "and on"]


def test_what_publishing_logs_is_not_published(run: Run, bus: Bus, logger: Any) -> None:
    subscriber = bus.subscriber(["sys/log"])

    class Chatty:
        def __init__(self, inner: Any) -> None:
            self.inner = inner

        def publish(self, *args: Any) -> None:
            logger.warning("publishing")
            self.inner.publish(*args)

    async def scenario() -> list[Received]:
        publisher = bus.publisher("service")
        await publisher.ready()
        await subscriber.ready()
        logger.addHandler(BusLogHandler(Chatty(publisher)))  # type: ignore[arg-type]
        logger.warning("one")
        first = await take(subscriber, 1)
        logger.warning("two")
        return first + await take(subscriber, 1)

    assert [item.message.data.message for item in run(scenario())] == ["one", "two"]


def test_logging_after_the_loop_ended_is_harmless(run: Run, bus: Bus, logger: Any) -> None:
    publisher = bus.publisher("service")

    async def scenario() -> None:
        logger.addHandler(BusLogHandler(publisher))

    run(scenario())
    logger.error("too late")
    assert publisher.sent == 0


def test_inside_the_service_a_connection_works_without_tcp(run: Run, broker: Broker) -> None:
    inside = Bus.connect(broker.inproc, broker.context)
    outside = Bus.connect(broker.endpoints)
    publishers = [inside.publisher("inside"), outside.publisher("outside")]
    subscribers = [inside.subscriber(), outside.subscriber()]

    async def scenario() -> None:
        await asyncio.gather(*(part.ready() for part in publishers), *(part.ready() for part in subscribers))
        for publisher in publishers:
            publisher.publish("user", "truth/left", 0, BODY)
        for subscriber in subscribers:
            assert {item.message.src for item in await take(subscriber, 2)} == {"inside", "outside"}

    run(scenario())
    inside.close()
    outside.close()
    assert outside.context.closed
    assert not broker.context.closed


def test_without_a_fresh_offset_a_party_publishes_invalid_messages(run: Run, broker: Broker, bus: Bus) -> None:
    own = ManualClock(1_000)
    clock = SyncedClock(own)
    away = Bus.connect(broker.endpoints, clock=clock)
    publisher, subscriber = away.publisher("away"), bus.subscriber()

    async def scenario() -> list[Received]:
        await publisher.ready()
        await subscriber.ready()
        publisher.publish("user", "truth/left", clock.to_bus(900), BODY)
        clock.on_burst([Exchange(1_000, 501_000, 1_000)])
        publisher.publish("user", "truth/left", clock.to_bus(900), BODY)
        own.advance(60_000_000_000)
        publisher.publish("user", "truth/left", clock.to_bus(900), BODY)
        return await take(subscriber, 3)

    messages = [item.message for item in run(scenario())]
    assert [message.valid for message in messages] == [False, True, False]
    assert (messages[1].t, messages[1].t_pub) == (500_900, 501_000)
    away.close()
