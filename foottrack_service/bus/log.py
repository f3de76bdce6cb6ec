"""``sys/log``: log records of warning and above."""

from __future__ import annotations

import logging

from foottrack_service.bus.publisher import Publisher


class BusLogHandler(logging.Handler):
    """Publishes records of all threads from the event loop that made it; at most ``per_second``, never its own."""

    def __init__(self, publisher: Publisher, per_second: int = 20) -> None:
        super().__init__(logging.WARNING)
