"""The recorder on a live bus."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from pydantic import StringConstraints

from foottrack_protocol.control import Code
from foottrack_protocol.topics import RAW_PREFIX, SYSTEM, Role, split_topic
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.endpoints import HWM
from foottrack_service.bus.errors import ControlError
from foottrack_service.bus.subscriber import Received
from foottrack_service.config import Settings, to_toml
from foottrack_service.recording.errors import DiskFullError, RecordingError
from foottrack_service.recording.writer import RecordingWriter, WriterStats

SUFFIX = ".mcap"
RecordingName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,100}$")]


async def run(
    bus: Bus,
    settings: Settings,
    path: Path,
    *,
    raw: bool = False,
    on_started: Callable[[RecordingWriter], None] | None = None,
) -> WriterStats:
    """Record all users' streams, as far as the registry says so, until cancelled: then the file is closed properly.

    With ``raw`` the sensors' own bytes and pictures are asked for, and recorded as well.
    ``on_started`` is called when nothing published from then on is missed. Raises RecordingError when the file cannot
    be made or the recording ends by itself: a DiskFullError leaves a whole file.
    """
    subscriber = bus.subscriber()
    recorded: dict[bytes, bool] = {}
    asked = {SYSTEM}

    def ask(user: str) -> None:
        # The subscription is what makes a sensor's node send them, so each user's has to be named.
        if raw and user not in asked:
            asked.add(user)
            subscriber.subscribe(f"{user}/{RAW_PREFIX}")

    def take(batch: list[Received]) -> None:
        for message, arrival, (topic, payload) in batch:
            wanted = recorded.get(topic)
            if wanted is None:
                ask(message.user)
                entry = split_topic(message.topic)[1]
                wanted = recorded[topic] = entry.recorded or (raw and entry.role is Role.RAW)
            if wanted:
                writer.write(topic, payload, arrival, message.t_pub, message.seq)

    try:
        ask(settings.user)
        await subscriber.ready()
        writer = RecordingWriter(path, to_toml(settings), bus.clock)
        try:
            if on_started is not None:
                on_started(writer)
            async for batch in subscriber.batches():
                take(batch)
                if writer.error is not None:
                    raise writer.error
        finally:
            take(subscriber.drain(HWM))
            await asyncio.shield(asyncio.to_thread(writer.close))
        return writer.stats
    finally:
        subscriber.close()


class Recorder:
    """Recordings on request, one at a time, into one folder and nowhere else."""

    def __init__(self, bus: Bus, settings: Settings, folder: Path) -> None:
        self._bus = bus
        self._settings = settings
        self._folder = folder.absolute()
        self._began = 0
        self._writer: RecordingWriter | None = None
        self._task: asyncio.Task[WriterStats] | None = None

    @property
    def handlers(self) -> dict[str, Callable[..., Any]]:
        """For the control socket: ``record/start {name, raw}`` and ``record/stop``."""
        return {"record/start": self.start, "record/stop": self.stop}

    @property
    def recording(self) -> bool:
        """Whether one runs, or has ended by itself and was not asked for yet."""
        return self._task is not None

    async def start(self, name: RecordingName, raw: bool = False) -> dict[str, Any]:
        """Begin ``<name>.mcap``. Raises ControlError: one runs already, or the file cannot be made."""
        if self._task is not None and not self._task.done():
            raise ControlError(Code.BUSY, "a recording is running already")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ControlError(Code.FAILED, f"{self._folder}: {error.strerror or error}") from None
        started: asyncio.Future[RecordingWriter] = asyncio.get_running_loop().create_future()
        path = self._folder / (name + SUFFIX)
        if path.exists():
            raise ControlError(Code.EXISTS, f"{path} exists already")
        self._writer = None
        self._began = self._bus.clock()
        self._task = asyncio.create_task(
            run(self._bus, self._settings, path, raw=raw, on_started=started.set_result), name="recorder"
        )
        waiting: set[asyncio.Future[Any]] = {self._task, started}
        await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        if not started.done():
            try:
                await self._task
            except RecordingError as error:
                self._task = None
                raise ControlError(Code.FAILED, str(error)) from None
        self._writer = started.result()
        return {"file": str(path)}

    async def stop(self) -> dict[str, Any]:
        """End the recording, and say what is in it. Raises ControlError: none runs, or it had ended badly."""
        task, writer = self._task, self._writer
        if task is None or writer is None:
            raise ControlError(Code.NOT_RUNNING, "nothing is being recorded")
        self._task = None
        task.cancel()
        try:
            await task
        except asyncio.CancelledError:
            pass
        except DiskFullError:
            pass  # whole up to there; the log said so when it happened
        except RecordingError as error:
            raise ControlError(Code.FAILED, str(error)) from None
        stats = writer.stats
        return {
            "file": str(writer.path),
            "messages": stats.written,
            "dropped": stats.dropped,
            "duration": (self._bus.clock() - self._began) * 1e-9,
        }
