"""IMUs on a serial line: samples in, the bytes out that the real device would send."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service.imu.formats import raw, rvc
from foottrack_service.imu.sample import DeviceSample, Quat, gravity_in_device

_POLE = 1.0 - 1e-9


class SimulatedDevice(ABC):
    """A device on a line. Samples are in its own axes and come at its own rate."""

    @abstractmethod
    def measure(self, sample: DeviceSample) -> bytes:
        """What it sends for one sample; empty while nobody has told it to."""

    def hear(self, data: bytes) -> bytes:
        """What it answers to the host."""
        return b""


class AsciiDevice(SimulatedDevice):
    """The text of Bayer 2021. Needs ``ticks`` (us) and ``q``."""

    def __init__(self, decimals: int = 4) -> None:
        self._decimals = decimals

    def measure(self, sample: DeviceSample) -> bytes:
        if sample.q is None or sample.ticks is None:
            raise ValueError("the ASCII format carries ticks and q")
        down = gravity_in_device(sample.q)
        x, y, z = (self._text(a - g) for a, g in zip(sample.acc, down, strict=True))
        i, j, k, r = (self._text(value) for value in sample.q)
        return f"{sample.ticks},L,{x},{y},{z};{sample.ticks},R,{r},{i},{j},{k};".encode()

    def _text(self, value: float) -> str:
        return f"{value:.{self._decimals}f}"


class RvcDevice(SimulatedDevice):
    """BNO08x in UART-RVC mode. Needs ``ticks`` (us) and ``q``: its index counts periods, also those of lost samples."""

    def measure(self, sample: DeviceSample) -> bytes:
        if sample.q is None or sample.ticks is None:
            raise ValueError("UART-RVC carries q, and an index that is made of ticks")
        yaw, pitch, roll = _angles(sample.q)
        milli_g = (_int16(a / STANDARD_GRAVITY * 1000.0) for a in sample.acc)
        index = round(sample.ticks / rvc.PERIOD_US) % 256
        body = rvc.PACKET.pack(index, -yaw, pitch, roll, *milli_g, 0, 0, 0)
        return rvc.HEADER + body + bytes([sum(body) & 0xFF])


class RawDevice(SimulatedDevice):
    """A microcontroller with our frame. Needs ``ticks`` (us) and ``gyro``."""

    def __init__(self) -> None:
        self._sequence = 0

    def measure(self, sample: DeviceSample) -> bytes:
        self._sequence += 1
        return raw.encode(sample, self._sequence - 1)


def _angles(q: Quat) -> tuple[int, int, int]:
    """Yaw, pitch, roll of Rz Rx Ry, right-handed, 0.01 deg."""
    x, y, z, w = q
    sine = max(-1.0, min(1.0, 2.0 * (y * z + w * x)))
    if abs(sine) > _POLE:
        # Only the sum or difference of yaw and roll is defined: all of it is called yaw.
        yaw, roll = 2.0 * math.atan2(z, w), 0.0
    else:
        yaw = math.atan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
        roll = math.atan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = math.remainder(yaw, 2.0 * math.pi)
    return _centidegrees(yaw), _centidegrees(math.asin(sine)), _centidegrees(roll)


def _centidegrees(angle: float) -> int:
    return round(math.degrees(angle) * 100.0)


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value)))
