"""``sys/session``: who serves this bus, once a second and in the answer to ``hello``."""

from __future__ import annotations

from collections.abc import Sequence

from foottrack_protocol.messages import Session
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.publisher import Publisher


class SessionInfo:
    """What does not change while the service runs."""

    def __init__(self, users: Sequence[str] = (), config_hash: str = "", clock: BusClock = now) -> None:
        self.session = ""

    def body(self) -> Session:
        """The session with a clock anchor taken now."""
        raise NotImplementedError


async def publish_session(publisher: Publisher, info: SessionInfo, period_s: float = 1.0) -> None:
    """Publish until cancelled."""
