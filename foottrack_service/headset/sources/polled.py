"""What runtimes that are asked for the head have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from foottrack_protocol.messages import Side
from foottrack_service.headset.rigid import Rigid


class HeadsetError(Exception):
    """A headset's runtime cannot be used; the text says what to do about it."""


@dataclass(frozen=True)
class Recentred:
    """The stage is another one from now on; ``moved`` takes the old one's coordinates to the new one's, if known."""

    moved: Rigid | None


@dataclass(frozen=True)
class Polled:
    """One answer. ``t`` bus clock, ns; ``head`` to stage, None when not tracked; ``recentred`` since the last answer,
    oldest first; ``truth`` has the feet's ankles."""

    t: int
    head: Rigid | None
    recentred: Sequence[Recentred] = ()
    truth: Mapping[Side, Rigid] = field(default_factory=dict)


class PolledSource(Protocol):
    """A runtime. Opened, asked and closed by one and the same thread."""

    def poll(self) -> Polled | None:
        """Ask now; None while the runtime is not ready. Raises HeadsetError when it is gone."""

    def close(self) -> None:
        """Let the runtime go."""
