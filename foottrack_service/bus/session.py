"""``sys/session``: who serves this bus, once a second and in the answer to ``hello``."""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import Sequence

from foottrack_protocol.envelope import PROTOCOL_MAJOR, PROTOCOL_MINOR
from foottrack_protocol.messages import ClockAnchor, ProtocolVersion, Session
from foottrack_protocol.topics import SYSTEM
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.publisher import Publisher


class SessionInfo:
    """What does not change while the service runs."""

    def __init__(self, users: Sequence[str] = (), config_hash: str = "", clock: BusClock = now) -> None:
        self.session = uuid.uuid4().hex[:12]
        self._users = list(users)
        self._config_hash = config_hash
        self._clock = clock

    def body(self) -> Session:
        """The session with a clock anchor taken now."""
        before = self._clock()
        unix = time.time_ns()
        after = self._clock()
        return Session(
            session=self.session,
            protocol=ProtocolVersion(major=PROTOCOL_MAJOR, minor=PROTOCOL_MINOR),
            clock=ClockAnchor(bus=(before + after) // 2, unix=unix),
            users=self._users,
            config_hash=self._config_hash,
        )


async def publish_session(publisher: Publisher, info: SessionInfo, period_s: float = 1.0) -> None:
    """Publish until cancelled."""
    while True:
        body = info.body()
        publisher.publish(SYSTEM, "session", body.clock.bus, body)
        await asyncio.sleep(period_s)
