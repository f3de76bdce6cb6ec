"""What a node gets: its way onto the bus."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import Self, TypeVar

import zmq

from foottrack_protocol.topics import Policy
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.control_client import ControlClient
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.health import HealthBoard
from foottrack_service.bus.publisher import Publisher
from foottrack_service.bus.security import credentials
from foottrack_service.bus.subscriber import Subscriber
from foottrack_service.bus.timesync import SyncedClock
from foottrack_service.config import BusSettings

M = TypeVar("M", Publisher, Subscriber, ControlClient)


class Bus:
    """Makes publishers and subscribers, and closes them. Belongs to one thread.

    Over TCP from any process (``Bus.connect(settings.bus)``), over inproc beside the broker
    (``Bus.connect(broker.inproc, broker.context)``). ``health`` is the board of this process.
    """

    def __init__(
        self, settings: BusSettings, outside: BusSettings, context: Context, own_context: bool, clock: BusClock
    ) -> None:
        self.settings = settings
        self.outside = outside
        self.context = context
        self.clock = clock
        self.health = HealthBoard()
        self._own_context = own_context
        self._credentials = credentials(settings.curve)
        self._made: list[Publisher | Subscriber | ControlClient] = []

    @classmethod
    def connect(
        cls,
        settings: BusSettings,
        context: Context | None = None,
        clock: BusClock = now,
        outside: BusSettings | None = None,
    ) -> Self:
        """Never waits: what it makes has ``ready``. A ``SyncedClock`` that is not fresh makes messages invalid.

        ``outside`` is where other processes of this host reach the same bus, if not at ``settings``.
        Raises KeyFileError where connections are to be encrypted.
        """
        return cls(settings, outside or settings, context or zmq.Context(), context is None, clock)

    def publisher(self, src: str) -> Publisher:
        """A source of messages called ``src``."""
        healthy = self.clock.fresh if isinstance(self.clock, SyncedClock) else None
        publisher = Publisher(self.context, self.settings.ingress, src, self.clock, healthy, self._credentials)
        return self._keep(publisher)

    def subscriber(self, topics: Iterable[str] = ("",), policy: Policy = Policy.EVERY) -> Subscriber:
        """Messages whose topic begins with one of ``topics``."""
        subscriber = Subscriber(self.context, self.settings.egress, topics, policy, self.clock, self._credentials)
        return self._keep(subscriber)

    def control(self) -> ControlClient:
        """Requests to the service."""
        client = ControlClient(self.context, self.settings.control, self._credentials)
        return self._keep(client)

    def close(self) -> None:
        """Close all that was made here, and the context if it is our own."""
        for made in self._made:
            made.close()
        self._made.clear()
        if self._own_context:
            self.context.term()

    def _keep(self, made: M) -> M:
        # A node that waits for its device makes and closes some at each try, for days.
        self._made = [each for each in self._made if not each.closed]
        self._made.append(made)
        return made

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
