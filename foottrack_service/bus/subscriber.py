"""Receives messages from the bus: drained through the socket's file descriptor, counted, decoded."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterable
from typing import NamedTuple

from foottrack_protocol.envelope import Message
from foottrack_protocol.topics import Policy
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.sequence import Stats

BATCH = 64
"""Messages taken from the socket before the event loop gets its turn: below 1 ms of decoding."""


class Received(NamedTuple):
    """A message, when it arrived (bus clock, ns), and its two frames unchanged."""

    message: Message
    arrival: int
    raw: tuple[bytes, bytes]


class Subscriber:
    """Messages whose topic begins with one of ``topics`` ("" is all). Belongs to one thread and one event loop.

    EVERY gives each message in order; LATEST gives, each time the reader comes back, the newest of each topic.
    What cannot be decoded is counted in ``stats`` and logged at most once a second. ``connections`` counts how often
    the bus was found: 2 after its first restart.
    """

    def __init__(
        self,
        context: Context,
        endpoint: str,
        topics: Iterable[str] = ("",),
        policy: Policy = Policy.EVERY,
        clock: BusClock = now,
    ) -> None:
        self.policy = policy
        self.stats = Stats()
        self.connections = 0

    async def ready(self, timeout_s: float = 5.0) -> None:
        """Wait until the bus knows the subscription. Raises NotReady."""

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """``ready`` without an event loop. Raises NotReady."""

    def drain(self, limit: int = BATCH) -> list[Received]:
        """What is there now, without waiting; at most ``limit`` messages leave the socket."""
        raise NotImplementedError

    async def batches(self) -> AsyncIterator[list[Received]]:
        """What came since the last batch, never empty; gives the event loop its turn between batches."""
        raise NotImplementedError
        yield []

    async def __aiter__(self) -> AsyncIterator[Received]:
        async for batch in self.batches():
            for received in batch:
                yield received

    def close(self) -> None:
        """Close; what was not read is lost."""
