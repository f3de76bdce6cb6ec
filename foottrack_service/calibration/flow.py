"""What every calibration shares: messages and instants in, progress and a result out. It reads no clock.

A flow is begun, then given what arrives and told the time; it ends with a result, or with a Refused that says why.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from foottrack_protocol import Message
from foottrack_protocol.control import Code
from foottrack_protocol.messages import Side

READY_TO_WAIT_S = 40.0
"""A person needs a few seconds to stand, and clients wait 60 s for an answer."""
SILENT_S = 3.0
"""A sensor of which nothing came for so long is not there."""


class Refused(Exception):
    """A calibration that did not succeed: the control socket's code, and what a person should know and do."""

    def __init__(self, code: Code, message: str) -> None:
        super().__init__(message)
        self.code, self.message = code, message


@dataclass(frozen=True, slots=True)
class Progress:
    """How far it is, 0 to 1, and what the person should do now."""

    share: float
    text: str


class Flow(ABC):
    """One calibration of one user."""

    streams: ClassVar[tuple[str, ...]] = ("head/pose",)
    """What it watches, as prefixes of the streams' names."""
    ready_to_wait_s: ClassVar[float] = READY_TO_WAIT_S

    def __init__(self) -> None:
        self.found: Any = None
        """The calibration's body, when it is done."""
        self.progress = Progress(0.0, "")
        self._began: int | None = None
        self._last_head: int | None = None

    def begin(self, now: int) -> None:
        """The person was told what to do at ``now``, ns."""
        self._began = now

    def take(self, message: Message, now: int) -> None:
        """A message that arrived at ``now``, ns. Raises Refused."""
        if self.found is not None or not message.valid:
            return
        if message.stream == "head/pose":
            if not message.data.tracked:
                self._on_untracked()
                return
            self._last_head = now
        self._take(message, now)

    def tick(self, now: int) -> None:
        """The time, at least a few times a second. Raises Refused."""
        began = self._began
        if self.found is not None or began is None:
            return
        heard = began if self._last_head is None else max(began, self._last_head)
        if (now - heard) * 1e-9 > SILENT_S:
            raise Refused(Code.UNAVAILABLE, f"no head pose for {SILENT_S:g} s: is the headset on, and tracked?")
        if (now - began) * 1e-9 > self.ready_to_wait_s:
            raise self._too_late()

    @abstractmethod
    def _take(self, message: Message, now: int) -> None:
        """What a flow does with a message; a head pose is a tracked one."""

    def _on_untracked(self) -> None:  # noqa: B027 - most flows have nothing to forget
        """The headset said that it does not know where it is."""

    @abstractmethod
    def _too_late(self) -> Refused:
        """Why it has not succeeded in time."""


def side_of(stream: str) -> Side | None:
    """The foot that a stream is of."""
    tail = stream.rpartition("/")[2]
    return "left" if tail == "left" else "right" if tail == "right" else None


def not_still(what: Mapping[str, str] | str, waited_s: float = READY_TO_WAIT_S) -> Refused:
    """Refused because the person moved."""
    text = what if isinstance(what, str) else "; ".join(f"{name}: {problem}" for name, problem in what.items())
    return Refused(Code.NOT_STILL, f"for {waited_s:g} s {text}")
