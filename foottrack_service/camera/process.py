"""The camera's own process: reads pictures, finds the feet, and publishes them.

A process, because 4 ms of work in a thread would cost the IMU path 4 ms; spawned, because OpenCV's threads do not
survive a fork. It publishes by itself, so that the service's process has none of its work; through a pipe the node
hears how it goes.
"""

from __future__ import annotations

import signal
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import cv2

from foottrack_protocol.errors import EncodeError
from foottrack_protocol.messages import CameraPreview, Optical, RawPicture
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.errors import BusError
from foottrack_service.bus.publisher import Publisher
from foottrack_service.camera import overlay, raw
from foottrack_service.camera.frame import Frame, Source, SourceEnded, SourceError
from foottrack_service.camera.marker_tracker import warm_up
from foottrack_service.camera.setup import Trackers, open_source
from foottrack_service.camera.shifts import in_shifts
from foottrack_service.config import Settings

SOURCE = "camera"
"""Who publishes."""
LATE_S = 0.1
"""A picture that is older than this when its feet are found is late."""
DARK_GREY = 25.0
PREVIEW_PERIOD_S = 0.2
TALLY_PERIOD_S = 0.5
_JUDGE_EVERY = 60


@dataclass(frozen=True)
class Fixes:
    """What one picture gave: (stream, `t`, body) each, how many pictures went missing before it, and how it was.

    `invalid` counts fixes that the wire would refuse.
    """

    fixes: tuple[tuple[str, int, Optical], ...]
    t: int
    dropped: int
    invalid: int
    late: bool
    dark: bool
    jpeg: bytes | None


@dataclass(frozen=True)
class Opened:
    """The source is open and delivers pictures."""


@dataclass(frozen=True)
class Tally:
    """What became of the pictures since the start, by kind and by reason, and what was wrong since the last tally."""

    good: Counter[str]
    bad: Counter[str]
    late: bool
    dark: bool


@dataclass(frozen=True)
class Ended:
    """No more pictures; `error` says why, None when a recorded sequence is over."""

    error: str | None


Report = Opened | Tally | Ended

STOP = "stop"
"""What the node tells the process."""


class Watcher:
    """One picture in, one report out; counts what is missing. Pure but for the clock it is given."""

    def __init__(self, trackers: Trackers, preview: bool, now: Callable[[], int]) -> None:
        self._trackers, self._preview, self._now = trackers, preview, now
        self._number: int | None = None
        self._shown: int | None = None
        self._shot: int | None = None
        self._seen = 0
        self._dark = False

    def report(self, frame: Frame) -> Fixes:
        """Find the feet."""
        fixes = self._trackers.process(frame)
        dropped = 0 if self._number is None else max(0, frame.number - self._number - 1)
        self._number = frame.number
        if self._seen % _JUDGE_EVERY == 0:
            self._dark = float(cv2.mean(frame.gray[::8, ::8])[0]) < DARK_GREY
        self._seen += 1
        jpeg = None
        if self._preview and (self._shown is None or not 0 <= frame.t - self._shown < PREVIEW_PERIOD_S * 1e9):
            self._shown = frame.t
            jpeg = overlay.jpeg(overlay.draw(frame, fixes, self._trackers.windows, self._trackers.rig))
        late = self._now() - frame.t > LATE_S * 1e9
        found = []
        for fix in fixes:
            with suppress(ValueError):
                found.append((f"{fix.kind}/{fix.side}", fix.t, fix.body()))
        return Fixes(tuple(found), frame.t, dropped, len(fixes) - len(found), late, self._dark, jpeg)

    def picture(self, frame: Frame) -> tuple[RawPicture, ...]:
        """The picture itself, where one is due."""
        if self._shot is not None and 0 <= frame.t - self._shot < raw.PERIOD_S * 1e9:
            return ()
        self._shot = frame.t
        return raw.pieces(frame, self._trackers.rig.intrinsics)


class _Speaker:
    """Publishes what was found, and counts it."""

    def __init__(self, publisher: Publisher, user: str) -> None:
        self._publisher, self._user = publisher, user
        self._good: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()
        self._late = self._dark = False

    @property
    def wants_pictures(self) -> bool:
        """Whether somebody asks for the pictures themselves."""
        return self._publisher.wanted(self._user, "raw/camera")

    def say(self, report: Fixes) -> None:
        """Publish a picture's fixes, and its preview."""
        for stream, t, body in report.fixes:
            self._publisher.publish(self._user, stream, t, body)
            self._good[stream.partition("/")[0]] += 1
        if report.jpeg is not None:
            try:
                self._publisher.publish(self._user, "camera/preview", report.t, CameraPreview(jpeg=report.jpeg))
            except EncodeError:
                self._bad["preview_too_large"] += 1
        self._good["pictures"] += 1
        self._bad.update(dropped=report.dropped, invalid=report.invalid, late=report.late)
        self._late |= report.late
        self._dark |= report.dark

    def show(self, t: int, pieces: tuple[RawPicture, ...]) -> None:
        """Publish a picture itself."""
        for piece in pieces:
            self._publisher.publish(self._user, "raw/camera", t, piece)

    def tally(self) -> Tally:
        """The counters now."""
        told = Tally(+self._good, +self._bad, self._late, self._dark)
        self._late = self._dark = False
        return told


def work(connection: Connection, settings: dict[str, Any]) -> None:
    """The process's main: until told to stop, the source's end, or an error that is told first.

    ``settings.bus`` is where this process reaches the bus.
    """
    # Ctrl-C reaches every process of the terminal; the node says when it is time.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Pictures come one by one: OpenCV's threads would only take the other core from fusion.
    cv2.setNumThreads(1)
    error: str | None = None
    try:
        loaded = Settings(**settings)
        # Before pictures come, so that none is late for it.
        warm_up()
        with Bus.connect(loaded.bus) as bus:
            publisher = bus.publisher(SOURCE)
            publisher.wait_ready()
            source = open_source(loaded, time.perf_counter_ns)
            try:
                _watch(connection, loaded, source, _Speaker(publisher, loaded.user))
            finally:
                source.close()
    except SourceEnded:
        pass
    except (SourceError, BusError, ValueError) as reason:
        error = str(reason)
    except (BrokenPipeError, ConnectionError, EOFError):
        return
    with suppress(OSError):
        connection.send(Ended(error))
    connection.close()


def _watch(connection: Connection, settings: Settings, source: Source, speaker: _Speaker) -> None:
    """Until told to stop. Raises SourceEnded, SourceError."""
    trackers = Trackers(settings.camera, source.intrinsics)
    watcher = Watcher(trackers, settings.camera.source.preview, time.perf_counter_ns)
    connection.send(Opened())

    def pictures(over: Callable[[], bool]) -> None:
        told = time.perf_counter()
        try:
            while not over():
                frame = source.read()
                speaker.say(watcher.report(frame))
                if speaker.wants_pictures:
                    # After the fixes, which are waited for.
                    speaker.show(frame.t, watcher.picture(frame))
                if time.perf_counter() - told > TALLY_PERIOD_S:
                    told = time.perf_counter()
                    connection.send(speaker.tally())
        finally:
            connection.send(speaker.tally())

    in_shifts(pictures, lambda timeout: connection.poll(timeout) and connection.recv() == STOP)
