"""Plays a recording on a live bus: paused, resumed, sought and sped up while it runs."""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple

from foottrack_protocol import Message
from foottrack_protocol.messages import Imu
from foottrack_protocol.topics import SYSTEM, TOPICS, Role
from foottrack_service.bus.errors import ControlError
from foottrack_service.recording.recording import Recorded, Recording
from foottrack_service.recording.replay import MAX_RATE, MIN_RATE, Pacer

KEY_SEEK_S = 5.0
BATCH = 64
"""Messages published before the event loop gets its turn, when the replay is behind."""


class Status(NamedTuple):
    """Where a replay is, in seconds from its beginning."""

    position: float
    duration: float
    rate: float
    paused: bool
    published: int


class LiveReplay:
    """Publishes a recording's messages at their own pace, their stamps moved to now.

    The messages keep source, stream and body; ``sid`` is new and ``seq`` without gaps, since nothing is lost on this
    bus, and ``user`` may be another. The service's own streams (``sys/...``) stay out. At another rate than 1 the
    stamps are stretched as well, so nothing is from the future, but bodies are as recorded: engines see the movement
    faster or slower, while filters see rates of turn that do not fit.

    ``roles`` picks streams by their role, all of them by default. Raises RecordingError for an empty recording.
    """

    def __init__(
        self,
        recording: Recording,
        publish: Callable[[Message], object],
        clock: Callable[[], int],
        *,
        rate: float = 1.0,
        loop: bool = False,
        user: str | None = None,
        roles: Collection[Role] = tuple(Role),
    ) -> None:
        self._recording = recording
        self._publish = publish
        self._clock = clock
        self._loop = loop
        self._user = user
        self._roles = roles
        self._changed = asyncio.Event()
        self._source: Iterator[Recorded] = iter(())
        self._seq: dict[tuple[str, str, str], int] = {}
        self._sid = ""
        self._sought = False
        self._published = 0
        self._pacer = Pacer(recording.require_span(), clock(), rate)
        self._begin(None)

    @property
    def handlers(self) -> dict[str, Callable[..., dict[str, Any]]]:
        """For the control socket: ``replay/pause|resume|seek|rate``, answered with the status."""
        return {
            "replay/pause": self.pause,
            "replay/resume": self.resume,
            "replay/seek": self.seek,
            "replay/rate": self.set_rate,
        }

    def on_key(self, key: str) -> bool:
        """What a key in the terminal does; False for the one that ends it.

        Space pauses and resumes, the arrows go 5 s back and forth, ``+`` and ``-`` double and halve the rate, ``0``
        begins anew, ``q`` ends.
        """
        status = self.status
        if key == "q":
            return False
        if key == " ":
            (self.resume if status.paused else self.pause)()
        elif key in ("left", "right"):
            self.seek(status.position + (KEY_SEEK_S if key == "right" else -KEY_SEEK_S))
        elif key in ("+", "-"):
            rate = status.rate * 2.0 if key == "+" else status.rate / 2.0
            self.set_rate(min(max(rate, MIN_RATE), MAX_RATE))
        elif key == "0":
            self.seek(0.0)
        return True

    @property
    def status(self) -> Status:
        """Where it is."""
        pacer, first = self._pacer, self._pacer.span.first
        position = (pacer.position(self._clock()) - first) * 1e-9
        return Status(position, pacer.span.seconds, pacer.rate, pacer.paused, self._published)

    def pause(self) -> dict[str, Any]:
        """Stand still."""
        self._pacer.pause(self._clock())
        return self._answer()

    def resume(self) -> dict[str, Any]:
        """Go on."""
        self._pacer.resume(self._clock())
        return self._answer()

    def seek(self, position: float) -> dict[str, Any]:
        """Go to ``position``, s from the beginning; kept within the recording."""
        if not abs(position) < 1e9:
            raise ControlError("bad_arguments", f"no position in a recording: {position}")
        wanted = self._pacer.span.first + round(position * 1e9)
        self._begin(self._pacer.seek(wanted, self._clock()))
        return self._answer()

    def set_rate(self, rate: float) -> dict[str, Any]:
        """Go on at ``rate`` times the recorded pace. Raises ControlError when it is out of range."""
        try:
            self._pacer.set_rate(rate, self._clock())
        except ValueError as error:
            raise ControlError("bad_arguments", str(error)) from None
        return self._answer()

    async def run(self) -> None:
        """Play to the end, or for ever in a loop. Raises RecordingError where the recording is damaged."""
        upcoming = self._next()
        while upcoming is not None:
            for _ in range(BATCH):
                wait = self._pacer.wait(upcoming.arrival, self._clock())
                if wait != 0 or self._changed.is_set():
                    break
                self._send(upcoming)
                upcoming = self._next()
                if upcoming is None:
                    return
            await self._pause_for(wait)
            if self._changed.is_set():
                self._changed.clear()
                if self._sought:
                    self._sought = False
                    upcoming = self._next()

    async def _pause_for(self, wait_ns: int | None) -> None:
        if wait_ns == 0 or self._changed.is_set():
            await asyncio.sleep(0)
            return
        try:
            async with asyncio.timeout(None if wait_ns is None else wait_ns * 1e-9):
                await self._changed.wait()
        except TimeoutError:
            return

    def _answer(self) -> dict[str, Any]:
        self._changed.set()
        return self.status._asdict()

    def _begin(self, since: int | None) -> None:
        self._source = self._recording.messages(since)
        self._sid = uuid.uuid4().hex[:12]
        self._seq.clear()
        self._sought = since is not None

    def _next(self) -> Recorded | None:
        for round_trip in (False, True):  # a loop over a recording without a wanted message ends
            for recorded in self._source:
                if self._wanted(recorded.message):
                    return recorded
            if round_trip or not self._loop:
                return None
            self._begin(None)
            self._pacer.seek(self._pacer.span.first, self._clock())
        return None

    def _wanted(self, message: Message) -> bool:
        return message.user != SYSTEM and TOPICS[message.stream].role in self._roles

    def _send(self, recorded: Recorded) -> None:
        message = recorded.message
        data = message.data
        if isinstance(data, Imu):
            data = data.model_copy(update={"t_arr": self._pacer.bus_time(data.t_arr)})
        user = self._user or message.user
        key = (user, message.stream, message.src)
        seq = self._seq.get(key, 0)
        self._seq[key] = seq + 1
        moved = message._replace(user=user, sid=self._sid, seq=seq, t=self._pacer.bus_time(message.t), data=data)
        self._publish(moved._replace(t_pub=self._clock()))
        self._published += 1
