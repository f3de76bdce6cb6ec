"""Sends messages to the bus, numbered without gaps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from foottrack_protocol.envelope import Message
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.endpoints import Context


class Publisher:
    """One source of messages. Belongs to one thread.

    ``sent`` counts messages handed to the bus, ``drops`` those that were not, by reason: "no_bus" (not ready, or the
    broker went away) and "full" (the bus does not keep up). Both leave a gap in ``seq``, so that receivers know.
    ``connections`` counts how often the bus was found: 2 after its first restart.
    """

    def __init__(
        self,
        context: Context,
        endpoint: str,
        src: str,
        clock: BusClock = now,
        healthy: Callable[[], bool] | None = None,
    ) -> None:
        """``healthy`` false marks all messages ``valid: false``: a party on another host without a fresh offset."""
        self.src = src
        self.sid = ""
        self.sent = 0
        self.drops: Counter[str] = Counter()
        self.connections = 0

    @property
    def live(self) -> bool:
        """Whether the bus takes what is published now."""
        raise NotImplementedError

    async def ready(self, timeout_s: float = 5.0) -> None:
        """Wait until the bus is there: nothing published after that is lost to a slow start. Raises NotReady."""

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """``ready`` without an event loop. Raises NotReady."""

    def publish(
        self, user: str, stream: str, t: int, data: Any, valid: bool = True, t_pub: int | None = None
    ) -> Message:
        """Publish a body that was true at ``t`` (bus clock, ns), and say the message as it was sent.

        Never blocks. Raises EncodeError, TopicError: what no receiver would take is neither sent nor numbered.
        """
        raise NotImplementedError

    def send(self, message: Message) -> None:
        """Send a message as it is, with its own ``src``, ``sid`` and ``seq`` (replay). Raises as ``publish``."""

    def send_frames(self, frames: tuple[bytes, bytes]) -> bool:
        """Send a message's bytes as they are. Says whether the bus took them."""
        raise NotImplementedError

    def close(self, linger_s: float = 1.0) -> None:
        """Close; what was sent may take so long to leave."""
