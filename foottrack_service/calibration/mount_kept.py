"""Which of the mounts that fusion finds in the background are kept for the next start."""

from __future__ import annotations

from foottrack_protocol import Message
from foottrack_protocol.messages import MountCalibration
from foottrack_service.fusion.core import SOURCE

PERIOD_S = 60.0
"""Fusion says it every 5 s; a file is written so often."""


class KeptMount:
    """Hears ``calibration`` messages. Instants in ns."""

    def __init__(self, base: str) -> None:
        self._base = base
        self._kept: int | None = None
        self.newest: MountCalibration | None = None
        """What is not kept yet."""

    def take(self, message: Message) -> None:
        """A message; others than fusion's, and of another mount than the configured one, are left out."""
        body = message.data
        if message.src == SOURCE and isinstance(body, MountCalibration) and body.values.base == self._base:
            self.newest = body

    def due(self, now: int) -> MountCalibration | None:
        """What is to be kept now, at most once a minute."""
        if self.newest is None or (self._kept is not None and (now - self._kept) * 1e-9 < PERIOD_S):
            return None
        found, self.newest, self._kept = self.newest, None, now
        return found
