"""The composition root: a bus, and the nodes that run on it in one process."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from foottrack_service.bridges import node as bridges_node
from foottrack_service.bus.broker import Broker
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.control import ControlServer
from foottrack_service.bus.errors import ControlError, NodeFailed
from foottrack_service.bus.health import publish_health
from foottrack_service.bus.log import BusLogHandler
from foottrack_service.bus.session import SessionInfo, publish_session
from foottrack_service.calibration.node import CalibrationDesk
from foottrack_service.calibration.store import Store
from foottrack_service.config import Settings
from foottrack_service.curve_settings import Role
from foottrack_service.fusion import node as fusion_node
from foottrack_service.headset import node as headset_node
from foottrack_service.imu import node as imu_node
from foottrack_service.recording import node as recording_node
from foottrack_service.recording.node import Recorder
from foottrack_service.recording.replay_desk import ReplayDesk

NodeRun = Callable[[Bus, Settings], Awaitable[None]]

FIRST_BACKOFF_S = 0.5
LONGEST_BACKOFF_S = 10.0

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Node:
    """A part of the service. A vital one ends the service when it fails; others are restarted.

    ``wanted`` says whether the settings ask for it; who names it by hand gets it in any case.
    """

    name: str
    run: NodeRun
    vital: bool = False
    wanted: Callable[[Settings], bool] = lambda settings: True


async def _camera(bus: Bus, settings: Settings) -> None:
    # OpenCV is loaded where somebody looks at pictures.
    from foottrack_service.camera import node

    await node.run(bus, settings)


NODES: dict[str, Node] = {
    "fusion": Node("fusion", fusion_node.run, vital=True),
    "imu": Node("imu", imu_node.run, wanted=lambda settings: not settings.imu.idle),
    "headset": Node("headset", headset_node.run, wanted=lambda settings: not settings.headset.idle),
    "camera": Node("camera", _camera, wanted=lambda settings: settings.camera.source.kind != "none"),
    "bridges": Node("bridges", bridges_node.run, wanted=lambda settings: not settings.bridges.idle),
}
"""Nodes by the name that ``foottrack node NAME`` takes."""


def recorder_node(path: Path) -> Node:
    """Records everything into ``path``. Vital: a person who asked for a recording wants to know when there is none."""

    async def run(bus: Bus, settings: Settings) -> None:
        await recording_node.run(bus, settings, path, on_started=lambda _: bus.health.node("recorder", "running"))

    return Node("recorder", run, vital=True)


class Service:
    """A bus with its control socket and the system's own topics; nodes are added to it.

    An async context manager: inside, everything runs; leaving it stops all of it in order.
    """

    def __init__(self, settings: Settings, store: Store | None = None) -> None:
        """``store`` keeps calibrations for the next start; without one they end with the service."""
        self.settings = settings
        self._store = store
        self._broker = Broker(settings.bus)
        self._tasks: list[asyncio.Task[None]] = []
        self._failure: asyncio.Future[None] | None = None

    async def __aenter__(self) -> Self:
        self._broker.start()
        try:
            await self._open()
        except BaseException:
            self._broker.stop()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for task in reversed(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        logging.getLogger().removeHandler(self._log_handler)
        if self._recorder.recording:
            # One that ended badly has said so in the log.
            with suppress(ControlError):
                await self._recorder.stop()
        self._control.close()
        self._replays.close()
        self.bus.close()
        self._broker.stop()

    @property
    def endpoints(self) -> Any:
        """Where the bus listens: BusSettings with the actual ports."""
        return self._endpoints

    @property
    def encrypted_endpoints(self) -> dict[Role, str]:
        """Where clients with keys of other hosts connect, by role; empty without ``[bus.curve] listen``."""
        doorkeeper = self._broker.doorkeeper
        return {} if doorkeeper is None else dict(doorkeeper.endpoints)

    def start(self, node: Node) -> asyncio.Task[None]:
        """Run a node beside the others; a device node that fails is started again with a growing pause."""
        task = asyncio.get_running_loop().create_task(self._supervise(node), name=node.name)
        self._tasks.append(task)
        return task

    async def running(self, name: str) -> None:
        """Wait until a node runs. Raises NodeFailed when a vital one fails meanwhile."""
        assert self._failure is not None
        waiting = asyncio.ensure_future(self.bus.health.wait_running(name))
        try:
            await asyncio.wait({waiting, self._failure}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            waiting.cancel()
        if self._failure.done():
            self._failure.result()

    async def failed(self) -> None:
        """Wait until a vital node fails. Raises NodeFailed."""
        assert self._failure is not None
        await asyncio.shield(self._failure)

    async def _open(self) -> None:
        self._failure = asyncio.get_running_loop().create_future()
        self.bus = Bus.connect(self._broker.inproc, self._broker.context, outside=self._broker.endpoints)
        if self._broker.doorkeeper is not None:
            self.bus.health.turned_away("door", self._broker.doorkeeper.refused)
        self._session = SessionInfo([self.settings.user], self.settings.digest)
        self._recorder = Recorder(self.bus, self.settings, self.settings.recording.folder)
        self._replays = ReplayDesk(self._broker.context)
        self._calibrations = CalibrationDesk(self.bus, self.settings, self._store)
        self._control = ControlServer(
            self._broker.context,
            self.settings.bus.control,
            {**self._recorder.handlers, **self._replays.handlers, **self._calibrations.handlers},
            session=self._session,
            board=self.bus.health,
            doorkeeper=self._broker.doorkeeper,
        )
        self._endpoints = self._broker.endpoints.model_copy(update={"control": self._control.endpoint})
        system = self.bus.publisher("service")
        monitor = self.bus.subscriber()
        await system.ready()
        await monitor.ready()
        self._log_handler = BusLogHandler(system)
        logging.getLogger().addHandler(self._log_handler)
        loop = asyncio.get_running_loop()
        self._tasks += [
            loop.create_task(self._control.run(), name="control"),
            loop.create_task(self._calibrations.run(), name="calibration"),
            loop.create_task(publish_session(system, self._session), name="session"),
            loop.create_task(publish_health(system, self.bus.health, monitor), name="health"),
        ]

    async def _supervise(self, node: Node) -> None:
        board = self.bus.health
        pause = FIRST_BACKOFF_S
        board.node(node.name, "starting")
        while True:
            started = self.bus.clock()
            try:
                await node.run(self.bus, self.settings)
            except asyncio.CancelledError:
                board.node(node.name, "stopped")
                raise
            except Exception as error:
                text = _readable(error)
                if node.vital:
                    board.node(node.name, "failed", text)
                    self._fail(node, error, text)
                    return
                _log.warning("%s failed and starts again in %.1f s: %s", node.name, pause, text)
                board.node(node.name, "restarting", text)
            else:
                board.node(node.name, "stopped")
                return
            if (self.bus.clock() - started) * 1e-9 > LONGEST_BACKOFF_S:
                pause = FIRST_BACKOFF_S
            await asyncio.sleep(pause)
            pause = min(2.0 * pause, LONGEST_BACKOFF_S)

    def _fail(self, node: Node, error: Exception, text: str) -> None:
        _log.error("%s failed: %s", node.name, text, exc_info=error)
        assert self._failure is not None
        with suppress(asyncio.InvalidStateError):
            self._failure.set_exception(NodeFailed(f"{node.name}: {text}"))


def _readable(error: BaseException) -> str:
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
