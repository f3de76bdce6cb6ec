"""The bridges: bodies from the bus to other applications, over UDP."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections import Counter

from foottrack_protocol.envelope import Message
from foottrack_protocol.topics import Policy
from foottrack_service.bridges.interface import Bridge, Pace
from foottrack_service.bridges.settings import BridgesSettings, TargetSettings
from foottrack_service.bridges.vmc import Vmc
from foottrack_service.bridges.vmt import Vmt
from foottrack_service.bridges.vrchat import Vrchat
from foottrack_service.bus.connection import Bus
from foottrack_service.config import Settings

SOURCE = "bridges"
_log = logging.getLogger(__name__)


async def run(bus: Bus, settings: Settings) -> None:
    """Send until cancelled, and say farewell then; ends at once where no bridge is asked for.

    What cannot be sent is lost, as UDP is. Raises OSError where a target's name is not known.
    """
    outputs: list[_Output] = []
    try:
        for name, target in settings.bridges.enabled.items():
            outputs.append(await _Output.open(name, _bridge(settings.bridges, name), target, target.port))
            bus.health.turned_away(name, outputs[-1].drops)
        if not outputs:
            return
        subscriber = bus.subscriber([f"{settings.user}/pose/body"], Policy.LATEST)
        await subscriber.ready()
        bus.health.node(SOURCE, "running")
        async for received in subscriber:
            if received.message.valid:
                for output in outputs:
                    output.send(received.message)
    finally:
        for output in outputs:
            output.close()


class _Output:
    """One bridge, its pace and its socket. ``drops`` counts datagrams that could not be sent."""

    def __init__(self, name: str, bridge: Bridge, pace: Pace, family: int, address: tuple[object, ...]) -> None:
        self._name = name
        self._bridge = bridge
        self._pace = pace
        self._address = address
        self._trouble = ""
        self.drops = Counter[str]()
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    @classmethod
    async def open(cls, name: str, bridge: Bridge, target: TargetSettings, port: int) -> _Output:
        loop = asyncio.get_running_loop()
        try:
            found = await loop.getaddrinfo(target.host, port, type=socket.SOCK_DGRAM)
        except OSError as error:
            raise OSError(f"[bridges.{name}] host {target.host!r}: {error.strerror or error}") from None
        family, _, _, _, address = found[0]
        _log.info("%s: bodies go to %s, port %d", name, target.host, port)
        return cls(name, bridge, Pace(target.max_hz), family, address)

    def send(self, message: Message) -> None:
        if self._pace.lets(message.t):
            self._send(self._bridge.datagrams(message.data, message.t))

    def close(self) -> None:
        self._send(self._bridge.farewell())
        self._socket.close()

    def _send(self, datagrams: list[bytes]) -> None:
        trouble = ""
        for datagram in datagrams:
            try:
                self._socket.sendto(datagram, self._address)
            except OSError as error:
                trouble = error.strerror or str(error)
                self.drops["unsent"] += 1
        if trouble != self._trouble:
            self._trouble = trouble
            if trouble:
                _log.warning("%s: cannot send to %s: %s", self._name, self._address[0], trouble)
            else:
                _log.info("%s: sends again", self._name)


def _bridge(settings: BridgesSettings, name: str) -> Bridge:
    match name:
        case "vmc":
            return Vmc(settings.vmc)
        case "vrchat":
            return Vrchat(settings.vrchat)
        case _:
            return Vmt(settings.vmt)
