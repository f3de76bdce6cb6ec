"""Calibrations on a live bus: the control requests, and what was found, published when it is found and every 5 s."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Annotated, Any

from pydantic import Field

from foottrack_protocol.control import Code
from foottrack_protocol.messages import (
    BodyCalibration,
    FloorCalibration,
    HeadingCalibration,
    ImuCalibration,
    MountCalibration,
)
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.errors import ControlError
from foottrack_service.calibration.body import BodyFlow
from foottrack_service.calibration.floor import FloorFlow
from foottrack_service.calibration.flow import Flow, Refused
from foottrack_service.calibration.heading import HeadingFlow
from foottrack_service.calibration.mount import MountFlow
from foottrack_service.calibration.mount_kept import KeptMount
from foottrack_service.calibration.store import Store, StoreError
from foottrack_service.config import Settings

SOURCE = "calibration"
REPEAT_S = 5.0
LOOK_S = 0.02
Height = Annotated[float, Field(gt=0.5, lt=2.6)]

_log = logging.getLogger(__name__)


class CalibrationDesk:
    """Runs the settings' user's calibrations, one at a time. Without a store nothing outlives the service."""

    def __init__(self, bus: Bus, settings: Settings, store: Store | None = None) -> None:
        self._bus, self._settings, self._store = bus, settings, store
        self._publisher = bus.publisher(SOURCE)
        self._known: dict[str, Any] = {}
        self._under_way: Flow | None = None
        self._keeping = asyncio.Lock()

    @property
    def handlers(self) -> dict[str, Callable[..., Any]]:
        """For the control socket."""
        return {
            "calibrate/floor": self.floor,
            "calibrate/heading": self.heading,
            "calibrate/body": self.body,
            "calibrate/mount": self.mount,
        }

    def floor(self, user: str | None = None) -> Awaitable[FloorCalibration]:
        """The floor's height. Raises ControlError, as all of them."""
        return self._run(user, lambda: FloorFlow(self._settings, self._mount))

    def heading(self, user: str | None = None) -> Awaitable[HeadingCalibration]:
        """Forward, and the IMUs' yaw."""
        return self._run(user, lambda: HeadingFlow(self._settings))

    def body(self, user: str | None = None, height: Height | None = None) -> Awaitable[BodyCalibration]:
        """The person's measures; ``height`` m, standing, if it is known."""
        return self._run(user, lambda: BodyFlow(self._settings, height, self._floor))

    def mount(self, user: str | None = None) -> Awaitable[MountCalibration]:
        """The camera's mount on the headset."""
        return self._run(user, lambda: MountFlow(self._settings))

    async def run(self) -> None:
        """Publish what is known, every 5 s, until cancelled; and keep what fusion finds of the mount meanwhile."""
        await self._publisher.ready()
        heard = self._bus.subscriber([f"{self._settings.user}/calibration"])
        background = KeptMount(self._settings.camera.mount_hash)
        try:
            await heard.ready()
            while True:
                for received in heard.drain():
                    background.take(received.message)
                await self._keep(background.due(self._bus.clock()))
                self._recall()
                for body in self._known.values():
                    self._publish(body)
                await asyncio.sleep(REPEAT_S)
        finally:
            heard.close()
            await self._keep(background.newest)

    @property
    def _floor(self) -> float:
        found = self._known.get("floor")
        return found.values.height if isinstance(found, FloorCalibration) else 0.0

    @property
    def _mount(self) -> Any:
        found = self._known.get("mount")
        return found.values if isinstance(found, MountCalibration) else None

    async def _run(self, user: str | None, make: Callable[[], Flow]) -> Any:
        if user is not None and user != self._settings.user:
            raise ControlError(Code.UNAVAILABLE, f"this service is {self._settings.user!r}'s, not {user!r}'s")
        if self._under_way is not None:
            # Also one that nobody waits for any more: whoever gave up should know when to try again.
            most = self._under_way.ready_to_wait_s
            raise ControlError(Code.BUSY, f"a calibration is under way already, and ends within {most:g} s")
        self._recall()
        self._under_way = make()
        try:
            found = await self._watch(self._under_way)
        except Refused as refused:
            raise ControlError(refused.code, refused.message) from None
        finally:
            self._under_way = None
        self._known[_name(found)] = found
        self._publish(found)
        await self._keep(found)
        return found

    async def _keep(self, found: Any) -> None:
        """In a thread: a disk takes 10 to 40 ms, in which the loop would publish no pose."""
        async with self._keeping:
            if self._store is None or found is None:
                return
            try:
                await asyncio.to_thread(self._store.keep, found)
            except StoreError as error:
                _log.warning("the calibration counts until the service ends: %s", error)
                self._store = None

    async def _watch(self, flow: Flow) -> Any:
        subscriber = self._bus.subscriber([f"{self._settings.user}/{stream}" for stream in flow.streams])
        try:
            await subscriber.ready()
            flow.begin(self._bus.clock())
            while flow.found is None:
                for received in subscriber.drain():
                    flow.take(received.message, received.arrival)
                flow.tick(self._bus.clock())
                await asyncio.sleep(0.0 if subscriber.pending else LOOK_S)
            return flow.found
        finally:
            subscriber.close()

    def _recall(self) -> None:
        # Each time anew: `calibrate imu` keeps what it finds from a process of its own.
        for body in [] if self._store is None else self._store.load():
            if not isinstance(body, BodyCalibration) or self._in_use(body):
                self._known[_name(body)] = body

    def _in_use(self, body: BodyCalibration) -> bool:
        # A measure that a flag or the environment sets is stronger than the one that was kept.
        return "body" in self._known or Skeleton.of(self._settings.body) == Skeleton.calibrated(body.values)

    def _publish(self, body: Any) -> None:
        self._publisher.publish(self._settings.user, "calibration", self._bus.clock(), body)


def _name(body: Any) -> str:
    return f"imu/{body.values.side}" if isinstance(body, ImuCalibration) else str(body.kind)
