"""A simulated person's hardware: IMUs on serial ports, a headset that sends datagrams, pictures for the camera.

What it sends takes every step that real devices' data take: bytes through a pty, decoder and dejitter; datagrams
through a socket; pictures through the detector in the camera's own process. Only the truth goes straight onto the bus.
"""

from __future__ import annotations

import asyncio
import socket
from types import TracebackType
from typing import Self

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.publisher import Publisher
from foottrack_service.camera.settings import RenderedSettings, SourceSettings
from foottrack_service.config import Settings
from foottrack_service.demo.pictures import affordable
from foottrack_service.headset.devices.vmc import VmcSender
from foottrack_service.headset.rigid import rigid
from foottrack_service.headset.settings import HeadsetSettings, VmcSettings
from foottrack_service.imu.devices.plugged import PluggedImu
from foottrack_service.imu.settings import Format, ImuDeviceSettings, ImuSettings
from foottrack_service.simulation import headset as simulated_headset
from foottrack_service.simulation import imu as simulated_imu
from foottrack_service.simulation.scenario import Scenario

PICTURES = ("rendered", "simulated", "none")
"""Where optical measurements come from: drawn pictures, the simulation (published as a camera would), or nowhere."""

RVC_HZ = 100.0
"""What a BNO08x in UART-RVC mode sends; other rates go by the ASCII format, which carries its time."""


class Hardware:
    """What a scenario's person wears, plugged in. ``notes`` has what a person should be told."""

    def __init__(self, scenario: Scenario, settings: Settings, imu_hz: float, pictures: str) -> None:
        """Plug in, and see how many pictures a second can be drawn here. Raises OSError: no UDP port is left."""
        self.notes: list[str] = []
        self._scenario = scenario
        self._settings = settings
        self._format: Format = "rvc" if imu_hz == RVC_HZ else "ascii"
        self._imus = self._plug_imus()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._address = ("127.0.0.1", _free_udp_port())
        self._headset = VmcSender()
        self._source = self._picture_source(pictures)

    @property
    def nodes(self) -> list[str]:
        """Names on the health board of what runs once a service has found everything."""
        camera = ["camera"] if self._source.kind == "rendered" else []
        return [*(f"imu-{side}" for side in self._imus), "headset", *camera]

    def found_by(self, start: int) -> Settings:
        """The settings with which a service finds it. ``start`` is when the scenario begins, bus clock, ns."""
        known = {"delay": simulated_imu.LATENCY_S, "format": self._format}
        imus = {side: ImuDeviceSettings.model_validate({**known, "port": imu.port}) for side, imu in self._imus.items()}
        vmc = VmcSettings(port=self._address[1], latency=simulated_headset.LATENCY_S)
        rendered = self._source.rendered.model_copy(update={"start": start})
        source = self._source.model_copy(update={"rendered": rendered})
        return self._settings.model_copy(
            update={
                "imu": ImuSettings(**imus),
                "headset": HeadsetSettings(source="vmc", vmc=vmc),
                "camera": self._settings.camera.model_copy(update={"source": source}),
            }
        )

    async def play(self, bus: Bus, start: int) -> None:
        """Send everything at its time, and the truth onto the bus, until the scenario ends. Raises NotReady.

        Every message has its deadline from the scenario's start, so lateness does not add up.
        """
        publishers: dict[str, Publisher] = {}
        direct = {e.src for e in self._scenario.emissions if not self._is_plugged(e.stream)}
        try:
            for src in sorted(direct):
                publishers[src] = bus.publisher(src)
                await publishers[src].ready()
            for _, message in self._scenario.at(start).messages():
                wait = message.t_pub - bus.clock()
                if wait > 0:
                    await asyncio.sleep(wait * 1e-9)
                self._send(message, start, publishers)
        finally:
            for publisher in publishers.values():
                publisher.close()

    def unplug(self) -> None:
        """Close ports and socket."""
        for imu in self._imus.values():
            imu.close()
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.unplug()

    def _plug_imus(self) -> dict[Side, PluggedImu]:
        try:
            return {side: PluggedImu(self._format) for side in SIDES}
        except OSError as error:
            self.notes.append(f"IMU samples go straight onto the bus, without serial bytes: {error}.")
            return {}

    def _picture_source(self, pictures: str) -> SourceSettings:
        source = self._settings.camera.source
        if pictures != "rendered":
            return source.model_copy(update={"kind": "none"})
        scene = {"task": self._scenario.task, "seed": self._scenario.seed, "seconds": self._scenario.seconds}
        rendered = RenderedSettings.model_validate(
            {**scene, "readout": source.rendered.readout, "latency": source.rendered.latency}
        )
        source = source.model_copy(update={"kind": "rendered", "rendered": rendered})
        camera = self._settings.camera.model_copy(update={"source": source})
        rate = affordable(self._settings.model_copy(update={"camera": camera}))
        if rate.hz < rendered.fps:
            self.notes.append(
                f"{rate.hz:g} pictures/s instead of {rendered.fps:g}: drawing and searching one takes "
                f"{1e3 * rate.cost_s:.0f} ms of a core here."
            )
        slowed = rendered.model_copy(update={"fps": min(rate.hz, rendered.fps)})
        return source.model_copy(update={"rendered": slowed})

    def _is_plugged(self, stream: str) -> bool:
        kind, _, side = stream.partition("/")
        return kind == "head" or (kind == "imu" and side in self._imus)

    def _send(self, message: Message, start: int, publishers: dict[str, Publisher]) -> None:
        kind, _, side = message.stream.partition("/")
        if kind == "head":
            body = message.data
            head = rigid(body.p, body.q) if body.tracked else None
            t_s = (message.t - start) * 1e-9
            self._socket.sendto(self._headset.datagram(t_s, head), self._address)
        elif kind == "imu" and (side == "left" or side == "right") and side in self._imus:
            self._imus[side].send(message.data)
        else:
            publishers[message.src].publish(self._settings.user, message.stream, message.t, message.data, message.valid)


def _free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
