"""What every bridge is: a body in, datagrams out. Pure: the node has the socket and the clock."""

from __future__ import annotations

from typing import Protocol

from foottrack_protocol.messages import BodyPose


class Bridge(Protocol):
    """One application's protocol. What is lost or unknown is never sent as if it were known."""

    def datagrams(self, pose: BodyPose, t: int) -> list[bytes]:
        """UDP payloads that say this pose, true at ``t`` (bus clock, ns)."""

    def farewell(self) -> list[bytes]:
        """UDP payloads that say that no more will come."""


class Pace:
    """Lets so many through in a second, evenly. Time is that of the poses: a restarted service begins anew."""

    def __init__(self, hz: float) -> None:
        self._period = round(1e9 / hz)
        self._due: int | None = None

    def lets(self, t: int) -> bool:
        """Whether what is true at ``t`` (ns) is to be sent."""
        due = self._due
        if due is not None and due - self._period <= t < due:
            return False
        on_time = due is not None and due <= t < due + self._period
        self._due = (due if on_time and due is not None else t) + self._period
        return True
