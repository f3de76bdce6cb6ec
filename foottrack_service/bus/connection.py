"""What a node gets: its way onto the bus."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import Self

from foottrack_protocol.topics import Policy
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.control import ControlClient
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.health import HealthBoard
from foottrack_service.bus.publisher import Publisher
from foottrack_service.bus.subscriber import Subscriber
from foottrack_service.config import BusSettings


class Bus:
    """Makes publishers and subscribers, and closes them. Belongs to one thread.

    Over TCP from any process (``Bus.connect(settings.bus)``), over inproc beside the broker
    (``Bus.connect(broker.inproc, broker.context)``).
    """

    def __init__(self, settings: BusSettings, context: Context, own_context: bool, clock: BusClock) -> None:
        self.settings = settings
        self.context = context
        self.clock = clock
        self.health = HealthBoard()

    @classmethod
    def connect(cls, settings: BusSettings, context: Context | None = None, clock: BusClock = now) -> Self:
        """Never waits: what it makes has ``ready``."""
        raise NotImplementedError

    def publisher(self, src: str) -> Publisher:
        """A source of messages called ``src``."""
        raise NotImplementedError

    def subscriber(self, topics: Iterable[str] = ("",), policy: Policy = Policy.EVERY) -> Subscriber:
        """Messages whose topic begins with one of ``topics``."""
        raise NotImplementedError

    def control(self) -> ControlClient:
        """Requests to the service."""
        raise NotImplementedError

    def close(self) -> None:
        """Close all that was made here, and the context if it is our own."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
