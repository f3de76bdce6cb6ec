"""The camera node: keeps the camera's process, and publishes what it finds."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import threading
from collections import Counter
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from foottrack_protocol.messages import CameraPreview
from foottrack_service.bus.connection import Bus
from foottrack_service.camera.marker_tracker import say_what_takes_long
from foottrack_service.camera.process import RAW_OFF, RAW_ON, STOP, Ended, Fixes, Opened, Picture, Report, work
from foottrack_service.config import Settings

SOURCE = "camera"
_STOP_S = 3.0
_WARN_PERIOD_NS = 10_000_000_000
_HEALTH_PERIOD_NS = 500_000_000

_log = logging.getLogger(__name__)


class CameraError(Exception):
    """The camera cannot be used, or its process died; the text says what to do."""


async def run(bus: Bus, settings: Settings) -> None:
    """Publish `marker/*`, `depth/*` and, if asked for, `camera/preview` and `raw/camera`.

    Until cancelled or the sequence ends. Raises CameraError; the service starts the node again after a pause.
    """
    publisher = bus.publisher(SOURCE)
    await publisher.ready()
    say_what_takes_long()
    process, connection = _start(settings)
    reports: asyncio.Queue[Report] = asyncio.Queue()
    reader = _read_in_thread(connection, reports)
    tally = _Tally(bus, settings.user)
    wants_raw = False
    try:
        while True:
            report = await reports.get()
            if isinstance(report, Opened):
                bus.health.node(SOURCE, "running")
            elif isinstance(report, Fixes):
                for stream, t, body in report.fixes:
                    publisher.publish(settings.user, stream, t, body)
                if report.jpeg is not None:
                    publisher.publish(settings.user, "camera/preview", report.t, CameraPreview(jpeg=report.jpeg))
                tally.add(report)
                if wants_raw != publisher.wanted(settings.user, "raw/camera"):
                    wants_raw = not wants_raw
                    _order(connection, RAW_ON if wants_raw else RAW_OFF)
            elif isinstance(report, Picture):
                for piece in report.pieces:
                    publisher.publish(settings.user, "raw/camera", report.t, piece)
            elif report.error is None:
                return
            else:
                raise CameraError(report.error)
    finally:
        tally.tell()
        await asyncio.to_thread(_stop, process, connection)
        # The process is gone, so the reader has met the pipe's end; closing under its feet could read another's file.
        reader.join(_STOP_S)
        connection.close()


class _Tally:
    """Counts pictures by what became of them, and warns now and then."""

    def __init__(self, bus: Bus, user: str) -> None:
        self._bus, self._name = bus, f"{user}/{SOURCE}"
        self._good: Counter[str] = Counter()
        self._bad: Counter[str] = Counter()
        self._told = 0
        self._warned: dict[str, int] = {}

    def add(self, report: Fixes) -> None:
        self._good["pictures"] += 1
        for stream, _, _ in report.fixes:
            self._good[stream.partition("/")[0]] += 1
        self._bad["dropped"] += report.dropped
        self._bad["invalid"] += report.invalid
        self._bad["late"] += report.late
        now = self._bus.clock()
        if report.late:
            self._warn(now, "late", "pictures are more than 100 ms old: fewer of them, or a faster machine")
        if report.dark:
            self._warn(now, "dark", "pictures are dark: more light, not a longer exposure, or feet blur")
        if now - self._told > _HEALTH_PERIOD_NS:
            self._told = now
            self.tell()

    def tell(self) -> None:
        self._bus.health.filter(self._name, +self._good, +self._bad)

    def _warn(self, now: int, kind: str, text: str) -> None:
        last = self._warned.get(kind)
        if last is None or now - last > _WARN_PERIOD_NS:
            self._warned[kind] = now
            _log.warning("camera: %s", text)


def _start(settings: Settings) -> tuple[Any, Connection]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(
        target=work, args=(theirs, settings.model_dump(mode="json")), name="foottrack-camera", daemon=True
    )
    process.start()
    # Only when ours is the last end open does reading theirs end.
    theirs.close()
    return process, ours


def _read_in_thread(connection: Connection, reports: asyncio.Queue[Report]) -> threading.Thread:
    """A thread, since Windows' pipes cannot be watched by the selector loop."""
    loop = asyncio.get_running_loop()

    def read() -> None:
        report: Report
        while True:
            try:
                report = connection.recv()
            except (EOFError, OSError):
                report = Ended("the camera's process died")
            # The loop may be closed by now: then nobody waits.
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(reports.put_nowait, report)
            if isinstance(report, Ended):
                return

    thread = threading.Thread(target=read, name="camera-reports", daemon=True)
    thread.start()
    return thread


def _order(connection: Connection, order: str) -> None:
    # Where the process is gone, its reports say so.
    with suppress(OSError):
        connection.send(order)


def _stop(process: Any, connection: Connection) -> None:
    _order(connection, STOP)
    process.join(_STOP_S)
    if process.is_alive():
        process.terminate()
        process.join(_STOP_S)
