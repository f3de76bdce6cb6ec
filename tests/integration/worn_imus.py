"""Simulated IMUs that are worn, at the other end of a pty or a socket."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import Imu
from foottrack_service import rotations
from foottrack_service.bus.clock import now
from foottrack_service.imu.axes import Axes
from foottrack_service.imu.devices.plugged import PluggedImu
from foottrack_service.imu.devices.slimevr import SlimeVrDevice

PERIOD_S = 0.005
TILT = rotations.from_axis_angle([0.0, 0.0, 1.0], 0.3)
"""Sensor to a y-up world, on the wire."""


def at_rest(t_dev_us: int = 0) -> Imu:
    x, y, z = rotations.unrotate(TILT, [0.0, STANDARD_GRAVITY, 0.0])
    q = tuple(float(v) for v in TILT)
    return Imu(acc=(float(x), float(y), float(z)), gyro=(0.1, 0.2, 0.3), q=q, t_dev=t_dev_us, t_arr=0)


class Wearer:
    """Plays a device into a pty in real time, at a name that stays when it is plugged in anew."""

    def __init__(self, port: Path, name: str) -> None:
        self._port = port
        self._name = name
        self._imu: PluggedImu | None = None

    def plug(self) -> None:
        self._imu = PluggedImu(self._name)
        fresh = self._port.with_suffix(".new")
        fresh.symlink_to(self._imu.port)
        fresh.replace(self._port)

    def unplug(self) -> None:
        if self._imu is not None:
            self._imu.close()
        self._imu = None

    def say(self, data: bytes) -> None:
        """Bytes as they are, between two packets."""
        assert self._imu is not None
        self._imu._pty.write(data)

    async def run(self) -> None:
        start = now()
        while True:
            if self._imu is not None:
                self._imu.send(at_rest((now() - start) // 1000))
            await asyncio.sleep(PERIOD_S)


class Datagrams(asyncio.DatagramProtocol):
    """A simulated tracker on a socket of its own."""

    def __init__(self, device: SlimeVrDevice) -> None:
        self._device = device
        imu = at_rest()
        self._sample = Axes().from_wire(imu.acc, imu.gyro, imu.q, None)

    def connection_made(self, transport: Any) -> None:
        self.transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        for reply in self._device.hear(data, now() * 1e-9):
            self.transport.sendto(reply)

    async def run(self) -> None:
        while True:
            for datagram in self._device.idle(now() * 1e-9) + self._device.measure(self._sample):
                self.transport.sendto(datagram)
            await asyncio.sleep(PERIOD_S)


async def stopped(*tasks: asyncio.Task[Any]) -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
