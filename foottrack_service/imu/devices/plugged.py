"""A simulated IMU that is plugged in: the wire's bodies go in, and its bytes come out of a serial port."""

from __future__ import annotations

from collections.abc import Callable

from foottrack_protocol.messages import Imu
from foottrack_service.imu.axes import FLAT_ON_THE_FOOT, Axes
from foottrack_service.imu.devices.bno08x import Bno08xDevice
from foottrack_service.imu.devices.pty_port import PtyPort
from foottrack_service.imu.devices.serial_devices import AsciiDevice, RawDevice, RvcDevice, SimulatedDevice

DEVICES: dict[str, Callable[[], SimulatedDevice]] = {
    "ascii": AsciiDevice,
    "rvc": RvcDevice,
    "bno08x": Bno08xDevice,
    "raw": RawDevice,
}
"""By the name of their format. ascii and rvc (100 Hz) need ``q``, raw needs ``gyro``, bno08x both."""


class PluggedImu:
    """A device of the given format on a pty; ``port`` is its name, for the setting of the same name.

    Raises OSError on Windows, which has no ptys.
    """

    def __init__(self, name: str, axes: str = FLAT_ON_THE_FOOT) -> None:
        self.device = DEVICES[name]()
        self._axes = Axes(axes)
        self._pty = PtyPort()
        self.port = self._pty.port

    def send(self, imu: Imu) -> None:
        """What the device measured just now. Its counter is ``t_dev``. Raises ValueError where a format needs more."""
        self.hear()
        self._pty.write(self.device.measure(self._axes.from_wire(imu.acc, imu.gyro, imu.q, imu.t_dev)))

    def hear(self) -> None:
        """Answer the host; ``send`` does it as well, so only a device that is idle needs it."""
        heard = self._pty.read()
        if heard:
            self._pty.write(self.device.hear(heard))

    def close(self) -> None:
        """Unplug it."""
        self._pty.close()
