"""``sys/health``: how the service is, once a second and in the answer to ``status``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from foottrack_protocol.messages import Health
from foottrack_service.bus.publisher import Publisher
from foottrack_service.bus.subscriber import Subscriber

NodeState = Literal["starting", "running", "restarting", "failed", "stopped"]


class HealthBoard:
    """Where all parts of a process report how they are."""

    def node(self, name: str, state: NodeState, error: str | None = None) -> None:
        """A node's state; "restarting" counts one restart."""

    def filter(self, name: str, accepted: Mapping[str, int], rejected: Mapping[str, int]) -> None:
        """What the filter ``user/side`` did with its measurements since its start: by kind, by reason."""

    def latency(self, ns: int) -> None:
        """One IMU sample's arrival to the hand-over of the pose it brought on."""

    def body(self) -> Health:
        """All of it, as it stood at the last tick."""
        raise NotImplementedError


async def publish_health(publisher: Publisher, board: HealthBoard, monitor: Subscriber, period_s: float = 1.0) -> None:
    """Count what ``monitor`` receives and publish until cancelled."""
