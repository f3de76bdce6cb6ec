"""The headset onto the bus: ``head/pose`` from the configured source, and ``truth/*`` from trackers on the feet."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from foottrack_protocol.messages import Truth
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.publisher import Publisher
from foottrack_service.config import Settings
from foottrack_service.headset.settings import HeadsetSettings
from foottrack_service.headset.sources.openvr import OpenVrSource
from foottrack_service.headset.sources.openxr import OpenXrSource
from foottrack_service.headset.sources.polled import HeadsetError, Polled, PolledSource
from foottrack_service.headset.sources.udp import DatagramSocket
from foottrack_service.headset.sources.vmc import VmcReceiver
from foottrack_service.headset.stream import HeadMessage, HeadStream

SOURCE = "headset"
_IDLE_S = 0.25
_TRY_AGAIN_S = 5.0

_log = logging.getLogger(__name__)


async def run(bus: Bus, settings: Settings) -> None:
    """Publish until cancelled; ends at once where the settings leave the head to the bus.

    Raises HeadsetError, and OSError where the UDP port is taken; the service starts the node again after a pause.
    """
    headset = settings.headset
    if headset.idle:
        return
    async with asyncio.TaskGroup() as tasks:
        if headset.source == "vmc":
            tasks.create_task(_receive(bus, settings))
        elif headset.source == "openxr":
            tasks.create_task(_ask(bus, settings, lambda: OpenXrSource(headset.openxr), _Head(bus, settings)))
        if headset.needs_openvr:
            head = _Head(bus, settings) if headset.source == "openvr" else None
            tasks.create_task(_ask_openvr(bus, settings, head))


class _Head:
    """Publishes one source's messages, and says how it is."""

    def __init__(self, bus: Bus, settings: Settings, stream: HeadStream | None = None) -> None:
        self.stream = HeadStream() if stream is None else stream
        self.publisher: Publisher = bus.publisher(SOURCE)
        self._bus, self._user = bus, settings.user

    def publish(self, message: HeadMessage | None) -> None:
        if message is not None:
            self.publisher.publish(self._user, "head/pose", message.t, message.body)

    def take(self, polled: Polled) -> None:
        for change in polled.recentred:
            self.stream.recentred(change.moved)
        if polled.head is None:
            self.publish(self.stream.lost(polled.t))
        else:
            self.publish(self.stream.pose(polled.t, polled.head))

    async def report(self) -> None:
        """Counts to the health board, until cancelled."""
        while True:
            self._bus.health.filter(f"{self._user}/{SOURCE}", self.stream.taken, self.stream.drops)
            await asyncio.sleep(_IDLE_S)


async def _receive(bus: Bus, settings: Settings) -> None:
    vmc = settings.headset.vmc
    receiver = VmcReceiver(vmc)
    head = _Head(bus, settings, receiver.stream)
    await head.publisher.ready()

    def on_datagram(data: bytes, t_arr: int) -> None:
        for message in receiver.receive(data, t_arr):
            head.publish(message)

    try:
        socket = await DatagramSocket.open(vmc.host, vmc.port, on_datagram, bus.clock)
    except OSError as error:
        head.publisher.close()
        raise OSError(f"UDP {vmc.host}:{vmc.port} for VMC: {error.strerror or error}") from None
    _log.info("headset: VMC is awaited on UDP %s:%d", vmc.host, socket.port)
    bus.health.node(SOURCE, "running")
    reporting = asyncio.ensure_future(head.report())
    try:
        while True:
            for message in receiver.idle(bus.clock()):
                head.publish(message)
            await asyncio.sleep(_IDLE_S)
    finally:
        reporting.cancel()
        socket.close()
        head.publisher.close()


async def _ask_openvr(bus: Bus, settings: Settings, head: _Head | None) -> None:
    """Truth alone is for evaluation: without SteamVR the head goes on."""

    def open_() -> PolledSource:
        return OpenVrSource(settings.headset.openvr, bus.clock)

    if head is not None:
        await _ask(bus, settings, open_, head)
    while True:
        try:
            await _ask(bus, settings, open_, None)
        except HeadsetError as error:
            bus.health.node("truth", "restarting", str(error))
        await asyncio.sleep(_TRY_AGAIN_S)


async def _ask(bus: Bus, settings: Settings, open_: Callable[[], PolledSource], head: _Head | None) -> None:
    """Ask a runtime at the configured rate, in a thread of its own: it may take its time, and wants one and the same.

    Raises HeadsetError.
    """
    loop = asyncio.get_running_loop()
    truth = bus.publisher("truth")
    await truth.ready()
    if head is not None:
        await head.publisher.ready()
    reporting = asyncio.ensure_future(asyncio.sleep(0.0) if head is None else head.report())
    try:
        with ThreadPoolExecutor(1, thread_name_prefix="headset") as thread:
            source = await loop.run_in_executor(thread, open_)
            bus.health.node("truth" if head is None else SOURCE, "running")
            try:
                due = loop.time()
                while True:
                    _publish(await loop.run_in_executor(thread, source.poll), bus, settings.user, head, truth)
                    due = max(due + _period_s(settings.headset), loop.time())
                    await asyncio.sleep(due - loop.time())
            finally:
                thread.submit(source.close)
    finally:
        reporting.cancel()
        truth.close()
        if head is not None:
            head.publisher.close()


def _publish(polled: Polled | None, bus: Bus, user: str, head: _Head | None, truth: Publisher) -> None:
    if polled is None:
        if head is not None and head.stream.silent(bus.clock()):
            head.publish(head.stream.lost(bus.clock()))
        return
    if head is not None:
        head.take(polled)
    for side, ankle in polled.truth.items():
        body = Truth(p=tuple(ankle.p.tolist()), q=tuple(ankle.q.tolist()))
        truth.publish(user, f"truth/{side}", polled.t, body)


def _period_s(headset: HeadsetSettings) -> float:
    return 1.0 / headset.rate
