"""BNO08x in its UART-RVC mode: 115200 8N1, 100 Hz, 19 bytes a sample.

``AA AA``, index, yaw, pitch, roll (int16 LE, 0.01 deg), acceleration with gravity (int16 LE, mg), three bytes that the
BNO080 leaves zero (the BNO086 does not), and the sum of bytes 2..17. Source: the BNO08x data sheet, 1.3.5.2.

The data sheet's text calls pitch the turn about y and roll the one about x; its own worked packet says otherwise:
only R = Rz(yaw) Rx(pitch) Ry(roll) makes its accelerations agree with its angles. That is also what the maker's driver
computes from the quaternion, and that one counts yaw clockwise, as a compass does.
"""

from __future__ import annotations

import math
import struct

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service.imu.sample import Decoder, DeviceClock, DeviceSample, Quat

HEADER = b"\xaa\xaa"
PACKET = struct.Struct("<BhhhhhhBBB")
LENGTH = len(HEADER) + PACKET.size + 1
PERIOD_US = 10_000

_HALF_CENTIDEGREE = math.radians(0.01) / 2.0
_MILLI_G = STANDARD_GRAVITY / 1000.0


class RvcDecoder(Decoder):
    """UART-RVC. Drops: ``checksum``, ``range`` (angles that cannot be) and ``garbage``, counted in bytes.

    The index counts samples, so it is the device's clock: 8 bits of 10 ms, as exact as the chip's rate.
    """

    clock = DeviceClock(modulus=256, tick_us=PERIOD_US, tolerance=0.05)

    def __init__(self, yaw_clockwise: bool = True) -> None:
        super().__init__()
        self._yaw_sign = -1.0 if yaw_clockwise else 1.0
        self._buffer = b""

    def feed(self, data: bytes) -> list[DeviceSample]:
        buffer = self._buffer + data
        samples = []
        at = 0
        while True:
            start = buffer.find(HEADER, at)
            if start < 0:
                # A last AA may be the first half of a header.
                start = len(buffer) - 1 if buffer.endswith(b"\xaa", at) else len(buffer)
                self.drops["garbage"] += start - at
                break
            self.drops["garbage"] += start - at
            if len(buffer) - start < LENGTH:
                break
            sample = self._packet(buffer, start)
            # After a false header the true one may be anywhere behind its first byte.
            at = start + (1 if sample is None else LENGTH)
            if sample is not None:
                samples.append(sample)
            else:
                self.drops["garbage"] += 1
        self._buffer = buffer[start:]
        return samples

    def _packet(self, buffer: bytes, start: int) -> DeviceSample | None:
        if sum(buffer[start + 2 : start + LENGTH - 1]) & 0xFF != buffer[start + LENGTH - 1]:
            self.drops["checksum"] += 1
            return None
        index, yaw, pitch, roll, ax, ay, az, *_ = PACKET.unpack_from(buffer, start + 2)
        if abs(yaw) > 18_000 or abs(pitch) > 9_000 or abs(roll) > 18_000:
            self.drops["range"] += 1
            return None
        q = quaternion(self._yaw_sign * yaw, pitch, roll)
        return DeviceSample(index, (ax * _MILLI_G, ay * _MILLI_G, az * _MILLI_G), q=q)


def quaternion(yaw: float, pitch: float, roll: float) -> Quat:
    """Rz(yaw) Rx(pitch) Ry(roll), each in 0.01 deg and right-handed, as ``[x, y, z, w]``."""
    sz, cz = math.sin(yaw * _HALF_CENTIDEGREE), math.cos(yaw * _HALF_CENTIDEGREE)
    sx, cx = math.sin(pitch * _HALF_CENTIDEGREE), math.cos(pitch * _HALF_CENTIDEGREE)
    sy, cy = math.sin(roll * _HALF_CENTIDEGREE), math.cos(roll * _HALF_CENTIDEGREE)
    return (
        cz * sx * cy - sz * cx * sy,
        cz * cx * sy + sz * sx * cy,
        sz * cx * cy + cz * sx * sy,
        cz * cx * cy - sz * sx * sy,
    )
