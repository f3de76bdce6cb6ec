"""``sys/log``: log records of warning and above."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import deque
from typing import Literal

from foottrack_protocol.messages import LogRecord
from foottrack_protocol.topics import SYSTEM
from foottrack_service.bus.clock import BusClock, now
from foottrack_service.bus.publisher import Publisher

_MAX_TEXT = 4_000
"""Characters of one message."""


class BusLogHandler(logging.Handler):
    """Publishes records of all threads; at most ``per_second``, and never one that came of publishing.

    Made in the event loop that owns the publisher, which does the publishing. What the rate held back is counted in
    the next record that passes.
    """

    def __init__(self, publisher: Publisher, per_second: int = 20, clock: BusClock = now) -> None:
        """Raises RuntimeError without a running event loop."""
        super().__init__(logging.WARNING)
        self._publisher = publisher
        self._per_second = per_second
        self._clock = clock
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[tuple[int, LogRecord]] = deque()
        self._publishing_in: int | None = None
        self._second = 0
        self._passed = 0
        self._held_back = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a record over to the event loop. Called by logging, in any thread, under the handler's lock."""
        if self._publishing_in == threading.get_ident() or self._loop.is_closed():
            return
        if not self._passes(int(record.created)):
            self._held_back += 1
            return
        try:
            self._waiting.append((self._clock(), self._body(record)))
            self._loop.call_soon_threadsafe(self._flush)
        except Exception:  # logging's own contract: a record that cannot be formatted never breaks its caller
            self.handleError(record)

    def _passes(self, second: int) -> bool:
        if second != self._second:
            self._second = second
            self._passed = 0
        self._passed += 1
        return self._passed <= self._per_second

    def _body(self, record: logging.LogRecord) -> LogRecord:
        text = record.getMessage()
        if record.exc_info and record.exc_info[1] is not None:
            error = record.exc_info[1]
            text = f"{text}: {type(error).__name__}: {error}"
        text = text[:_MAX_TEXT].encode(errors="replace").decode()
        if self._held_back:
            text = f"{text} ({self._held_back} more were held back)"
            self._held_back = 0
        return LogRecord(level=_level(record.levelno), logger=record.name, message=text)

    def _flush(self) -> None:
        self._publishing_in = threading.get_ident()
        try:
            while self._waiting:
                t, body = self._waiting.popleft()
                self._publisher.publish(SYSTEM, "log", t, body)
        finally:
            self._publishing_in = None


def _level(number: int) -> Literal["warning", "error", "critical"]:
    if number >= logging.CRITICAL:
        return "critical"
    return "error" if number >= logging.ERROR else "warning"
