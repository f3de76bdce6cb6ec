"""What the tests of the bus send and how they take it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from foottrack_protocol.messages import Truth
from foottrack_service.bus import Broker, ControlServer, Publisher, Received, Subscriber
from foottrack_service.config import BusSettings

BODY = Truth(p=(0.1, 0.2, 0.3), q=(0.0, 0.0, 0.0, 1.0))


def publish(publisher: Publisher, count: int, stream: str = "truth/left") -> None:
    """As many messages of one stream."""
    for _ in range(count):
        publisher.publish("user", stream, 0, BODY)


async def take(subscriber: Subscriber, count: int) -> list[Received]:
    """The next batches, until they hold ``count`` messages."""
    taken: list[Received] = []
    async for batch in subscriber.batches():
        taken += batch
        if len(taken) >= count:
            break
    return taken


@asynccontextmanager
async def answering(broker: Broker) -> AsyncIterator[BusSettings]:
    """The broker with a control socket beside it, as commands need it; where they connect."""
    server = ControlServer(broker.context, "tcp://127.0.0.1:0", {})
    serving = asyncio.ensure_future(server.run())
    try:
        yield broker.endpoints.model_copy(update={"control": server.endpoint})
    finally:
        server.close()
        await serving
