"""The IMUs of both feet onto the bus."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from functools import partial

from foottrack_protocol.messages import Side
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.publisher import Publisher
from foottrack_service.config import Settings
from foottrack_service.imu import ports
from foottrack_service.imu.formats import SERIAL_FORMATS
from foottrack_service.imu.link import SerialLink
from foottrack_service.imu.settings import ImuDeviceSettings
from foottrack_service.imu.slimevr import Address, SlimeVrServer, TrackerSample
from foottrack_service.imu.stream import SerialStream, Stamped, Stamper
from foottrack_service.imu.tap import Tap
from foottrack_service.imu.udp import SlimeVrSocket

REPORT_S = 1.0

_log = logging.getLogger(__name__)


async def run(bus: Bus, settings: Settings) -> None:
    """Publish ``imu/left`` and ``imu/right`` from the devices that the settings name, until cancelled.

    A device that is missing or unplugged is awaited and disturbs nobody else. Raises OSError when the socket for
    SlimeVR trackers cannot be opened.
    """
    devices: dict[Side, ImuDeviceSettings] = {"left": settings.imu.left, "right": settings.imu.right}
    serial = {side: device.port for side, device in devices.items() if device.format in SERIAL_FORMATS}
    allotment = ports.Allotment(serial)
    wired: list[_SerialFoot] = []
    trackers: list[_TrackerFoot] = []
    for side, device in devices.items():
        if device.format == "slimevr":
            trackers.append(_TrackerFoot(bus, settings.user, side, device))
        elif side in serial:
            wired.append(_SerialFoot(bus, settings.user, side, device, allotment))
    try:
        async with asyncio.TaskGroup() as tasks:
            for foot in wired:
                tasks.create_task(foot.run(), name=foot.name)
            if trackers:
                await _start_trackers(tasks, bus, settings, trackers)
    finally:
        # Where the trackers' port is taken, the service tries again for as long as it runs.
        for each in (*wired, *trackers):
            each.publisher.close()


class _Foot:
    """One side's publisher."""

    def __init__(self, bus: Bus, user: str, side: Side, format_: str) -> None:
        self._user = user
        self._board = bus.health
        self._published = 0
        self._stream = f"imu/{side}"
        self._reported: Counter[str] = Counter()
        self.name = f"imu-{side}"
        self.publisher: Publisher = bus.publisher(self.name)
        self.tap = Tap(self.publisher, user, side, format_)

    def publish(self, stamped: Stamped) -> None:
        self.publisher.publish(self._user, self._stream, stamped.t, stamped.imu)
        self._published += 1

    def report(self, drops: Counter[str]) -> None:
        """Say what was dropped since the last report, in the log, and since the start, in ``sys/health``."""
        self._board.filter(f"{self._user}/{self.name}", {"imu": self._published}, drops)
        fresh = drops - self._reported
        if fresh:
            text = ", ".join(f"{count} {reason}" for reason, count in sorted(fresh.items()))
            _log.warning("%s dropped: %s", self.name, text)
        self._reported = Counter(drops)


class _SerialFoot(_Foot):
    def __init__(self, bus: Bus, user: str, side: Side, device: ImuDeviceSettings, allotment: ports.Allotment) -> None:
        super().__init__(bus, user, side, device.format)
        self._side = side
        self._allotment = allotment
        self._bus = bus
        self._running = False
        self._source = SerialStream(device)
        known = SERIAL_FORMATS[device.format]
        self._link = SerialLink(
            self.name,
            self._find_port,
            device.baud or known.baud,
            on_open=self._source.replugged,
            on_data=self._on_data,
            to_send=self._source.to_send,
            clock=bus.clock,
            byte_gap_s=known.byte_gap_s,
            on_state=self._on_state,
        )

    async def run(self) -> None:
        await self.publisher.ready()
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._link.run())
            tasks.create_task(self._report())

    async def _report(self) -> None:
        while True:
            self.report(self._source.drops)
            await asyncio.sleep(REPORT_S)

    def _on_state(self, failure: str | None) -> None:
        board = self._bus.health
        if failure is None:
            board.node(self.name, "running")
        elif self._link.connections == 0:
            board.node(self.name, "starting", failure)
        elif self._running:
            board.node(self.name, "restarting", failure)
        self._running = failure is None

    def _find_port(self) -> str:
        return self._allotment.find(self._side, ports.available())

    def _on_data(self, data: bytes, t_arr: int) -> None:
        for stamped in self._source.feed(data, t_arr):
            self.publish(stamped)
        self.tap.publish(data, t_arr, self._link.port or "", self._link.connections)


class _TrackerFoot(_Foot):
    def __init__(self, bus: Bus, user: str, side: Side, device: ImuDeviceSettings) -> None:
        super().__init__(bus, user, side, device.format)
        self.wanted = None if device.port == "auto" else _tracker_name(device.port)
        self.stamper = Stamper(device, None)
        self.acc_turn = device.acc_turn

    @property
    def mac(self) -> str | None:
        """Of the tracker that is on this foot, None before that is known."""
        return None if self.wanted is None else self.wanted.split("/")[0]


async def _start_trackers(tasks: asyncio.TaskGroup, bus: Bus, settings: Settings, feet: list[_TrackerFoot]) -> None:
    server = SlimeVrServer(partial(_acc_turn, feet))
    for foot in feet:
        await foot.publisher.ready()
    bus.health.turned_away("slimevr", server.drops)
    imu = settings.imu
    socket = await SlimeVrSocket.open(
        imu.slimevr_host,
        imu.slimevr_port,
        server,
        partial(_on_tracker_sample, feet),
        bus.clock,
        partial(_on_datagram, feet, server),
    )
    tasks.create_task(socket.run(), name="slimevr")
    tasks.create_task(_watch_trackers(bus, server, feet), name="slimevr watch")


def _foot_of(feet: list[_TrackerFoot], name: str) -> _TrackerFoot | None:
    """The foot that a sensor is on: first come, first served where none is named."""
    found = next((foot for foot in feet if foot.wanted == name), None)
    return found or next((foot for foot in feet if foot.wanted is None), None)


def _acc_turn(feet: list[_TrackerFoot], name: str) -> float | None:
    foot = _foot_of(feet, name)
    return None if foot is None else foot.acc_turn


def _on_tracker_sample(feet: list[_TrackerFoot], sample: TrackerSample, t_arr: int) -> None:
    foot = _foot_of(feet, sample.name)
    if foot is None:
        return
    if foot.wanted is None:
        # It stays so: which foot it is on is found by tapping.
        foot.wanted = sample.name
        _log.info("%s: taken by tracker %s", foot.name, sample.name)
    stamped = foot.stamper.stamp(sample.sample, t_arr, None)
    if stamped is not None:
        foot.publish(stamped)


def _on_datagram(feet: list[_TrackerFoot], server: SlimeVrServer, data: bytes, address: Address, t_arr: int) -> None:
    name, handshake = server.introduction(address) or (None, None)
    theirs = [foot for foot in feet if name is not None and foot.mac == name]
    # What is nobody's may be what a foot without its tracker waits for.
    for foot in theirs or [foot for foot in feet if foot.mac not in server.trackers]:
        foot.tap.publish(data, t_arr, f"{address[0]}:{address[1]}", 0, foot.wanted, handshake)


async def _watch_trackers(bus: Bus, server: SlimeVrServer, feet: list[_TrackerFoot]) -> None:
    reported: Counter[str] = Counter()
    while True:
        for foot in feet:
            if foot.mac in server.trackers:
                bus.health.node(foot.name, "running")
            else:
                bus.health.node(foot.name, "starting", f"waits for tracker {foot.wanted or '(any)'}")
            foot.report(foot.stamper.drops)
        fresh = server.drops - reported
        if fresh:
            _log.warning("slimevr dropped: %s", dict(fresh))
        reported = Counter(server.drops)
        await asyncio.sleep(REPORT_S)


def _tracker_name(port: str) -> str:
    """``AA:BB:CC:DD:EE:FF`` is its first sensor."""
    mac, _, sensor = port.partition("/")
    return f"{mac.upper()}/{sensor or 0}"
