"""The camera's own process: reads pictures, finds the feet, and tells the node through a pipe.

A process, because 4 ms of work in a thread would cost the IMU path 4 ms; spawned, because OpenCV's threads do not
survive a fork.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import cv2

from foottrack_protocol.messages import Optical, RawPicture
from foottrack_service.camera import overlay, raw
from foottrack_service.camera.frame import Frame, Source, SourceEnded, SourceError
from foottrack_service.camera.marker_tracker import warm_up
from foottrack_service.camera.setup import Trackers, open_source
from foottrack_service.config import Settings

LATE_S = 0.1
"""A picture that is older than this when its feet are found is late."""
DARK_GREY = 25.0
PREVIEW_PERIOD_S = 0.2
_JUDGE_EVERY = 60
_NICENESS = 10
_BELOW_NORMAL_PRIORITY_CLASS = 0x4000


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
class Ended:
    """No more pictures; `error` says why, None when a recorded sequence is over."""

    error: str | None


@dataclass(frozen=True)
class Picture:
    """A picture itself, taken at `t`, while somebody asks for it."""

    t: int
    pieces: tuple[RawPicture, ...]


Report = Opened | Fixes | Picture | Ended

STOP = "stop"
RAW_ON, RAW_OFF = "raw on", "raw off"
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

    def picture(self, frame: Frame) -> Picture | None:
        """The picture itself, where one is due."""
        if self._shot is not None and 0 <= frame.t - self._shot < raw.PERIOD_S * 1e9:
            return None
        self._shot = frame.t
        return Picture(frame.t, raw.pieces(frame, self._trackers.rig.intrinsics))


def work(connection: Connection, settings: dict[str, Any]) -> None:
    """The process's main: until told to stop, the source's end, or an error that is told first."""
    # Ctrl-C reaches every process of the terminal; the node says when it is time.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _yield_to_others()
    # Pictures come one by one: OpenCV's threads would only take the other core from fusion.
    cv2.setNumThreads(1)
    source: Source | None = None
    try:
        loaded = Settings(**settings)
        # Before pictures come, so that none is late for it.
        warm_up()
        source = open_source(loaded, time.perf_counter_ns)
        trackers = Trackers(loaded.camera, source.intrinsics)
        connection.send(Opened())
        watcher = Watcher(trackers, loaded.camera.source.preview, time.perf_counter_ns)
        wants_raw = False
        while True:
            while connection.poll():
                order = connection.recv()
                if order == STOP:
                    return
                wants_raw = order == RAW_ON
            frame = source.read()
            connection.send(watcher.report(frame))
            # After the fixes, which are waited for.
            picture = watcher.picture(frame) if wants_raw else None
            if picture is not None:
                connection.send(picture)
    except SourceEnded:
        _tell(connection, Ended(None))
    except (SourceError, ValueError) as error:
        _tell(connection, Ended(str(error)))
    except (BrokenPipeError, ConnectionError, EOFError):
        pass
    finally:
        if source is not None:
            source.close()
        connection.close()


def _yield_to_others() -> None:
    """A picture may wait, an IMU's sample may not: where cores are few, fusion goes first."""
    if sys.platform == "win32":
        import ctypes

        kernel = ctypes.windll.kernel32
        kernel.GetCurrentProcess.restype = ctypes.c_void_p
        kernel.SetPriorityClass(ctypes.c_void_p(kernel.GetCurrentProcess()), _BELOW_NORMAL_PRIORITY_CLASS)
    else:
        os.nice(_NICENESS)


def _tell(connection: Connection, ended: Ended) -> None:
    try:
        connection.send(ended)
    except OSError:
        return
