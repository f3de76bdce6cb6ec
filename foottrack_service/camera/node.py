"""The camera node: keeps the camera's process, which publishes, and says how it is."""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from foottrack_service.bus.connection import Bus
from foottrack_service.camera.marker_tracker import say_what_takes_long
from foottrack_service.camera.process import SOURCE, STOP, Ended, Opened, Report, Tally, work
from foottrack_service.config import Settings

_STOP_S = 3.0
_WARN_PERIOD_NS = 10_000_000_000

_log = logging.getLogger(__name__)


class CameraError(Exception):
    """The camera cannot be used, or its process died; the text says what to do."""


async def run(bus: Bus, settings: Settings) -> None:
    """Have `marker/*`, `depth/*` and, if asked for, `camera/preview` and `raw/camera` published.

    Until cancelled or the sequence ends. Raises CameraError; the service starts the node again after a pause.
    """
    say_what_takes_long()
    process, connection = _start(settings.model_copy(update={"bus": bus.outside}))
    reports: asyncio.Queue[Report] = asyncio.Queue()
    reader = _read_in_thread(connection, reports)
    warnings = _Warnings(bus)
    try:
        while True:
            report = await reports.get()
            if isinstance(report, Opened):
                bus.health.node(SOURCE, "running")
            elif isinstance(report, Tally):
                bus.health.filter(f"{settings.user}/{SOURCE}", report.good, report.bad)
                warnings.add(report)
            elif report.error is None:
                return
            else:
                raise CameraError(report.error)
    finally:
        await asyncio.to_thread(_stop, process, connection)
        # The process is gone, so the reader has met the pipe's end; closing under its feet could read another's file.
        reader.join(_STOP_S)
        connection.close()


class _Warnings:
    """What is wrong with the pictures, said now and then."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._warned: dict[str, int] = {}

    def add(self, tally: Tally) -> None:
        if tally.late:
            self._warn("late", "pictures are more than 100 ms old: fewer of them, or a faster machine")
        if tally.dark:
            self._warn("dark", "pictures are dark: more light, not a longer exposure, or feet blur")

    def _warn(self, kind: str, text: str) -> None:
        now, last = self._bus.clock(), self._warned.get(kind)
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


def _stop(process: Any, connection: Connection) -> None:
    # Where the process is gone, its reports say so.
    with suppress(OSError):
        connection.send(STOP)
    process.join(_STOP_S)
    if process.is_alive():
        process.terminate()
        process.join(_STOP_S)
