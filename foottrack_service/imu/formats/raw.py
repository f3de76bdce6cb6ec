"""Our frame for microcontrollers with a plain accelerometer and gyroscope; ``protocol/RAW_IMU.md`` is its description.

COBS with a final zero around, little-endian: version (1), sequence number, micros() as uint32, specific force
(3 float32, m/s^2), angular rate (3 float32, rad/s), CRC-16 of all before.
"""

from __future__ import annotations

import binascii
import struct

from foottrack_service.imu.formats import cobs
from foottrack_service.imu.formats.framing import Splitter
from foottrack_service.imu.sample import Decoder, DeviceClock, DeviceSample

VERSION = 1
BODY = struct.Struct("<BBI6f")
CRC = struct.Struct("<H")
MAX_ACC = 4000.0
"""m/s^2: 400 g, the largest range that is sold."""
MAX_GYRO = 200.0
"""rad/s."""

_LONGEST = 64


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE: polynomial 0x1021, start 0xFFFF, not reflected; of ``123456789`` it is 0x29B1."""
    return binascii.crc_hqx(data, 0xFFFF)


class RawDecoder(Decoder):
    """Raw frames. Drops: ``framing``, ``length``, ``crc``, ``version``, ``range`` (NaN too), ``overlong``; ``lost``
    counts what the sequence numbers show to be missing."""

    clock = DeviceClock(modulus=1 << 32, tick_us=1.0, tolerance=0.01)

    def __init__(self) -> None:
        super().__init__()
        self._splitter = Splitter(b"\0", _LONGEST, self.drops)
        self._sequence: int | None = None

    def feed(self, data: bytes) -> list[DeviceSample]:
        samples = []
        for frame in self._splitter.feed(data):
            sample = self._parse(frame)
            if isinstance(sample, str):
                self.drops[sample] += 1
            else:
                samples.append(sample)
        return samples

    def _parse(self, frame: bytes) -> DeviceSample | str:
        """The sample, or why there is none."""
        message = cobs.decode(frame)
        if message is None:
            return "framing"
        if len(message) < 1 + CRC.size or message[-2:] != CRC.pack(crc16(message[:-2])):
            return "crc"
        if message[0] != VERSION:
            return "version"
        if len(message) != BODY.size + CRC.size:
            return "length"
        _, sequence, micros, ax, ay, az, gx, gy, gz = BODY.unpack_from(message)
        acc, gyro = (ax, ay, az), (gx, gy, gz)
        if not (all(abs(a) <= MAX_ACC for a in acc) and all(abs(g) <= MAX_GYRO for g in gyro)):
            return "range"
        missing = 0 if self._sequence is None else (sequence - self._sequence - 1) % 256
        # A count that goes back is that of a device that started anew.
        if 0 < missing < 128:
            self.drops["lost"] += missing
        self._sequence = sequence
        return DeviceSample(micros, acc, gyro)


def encode(sample: DeviceSample, sequence: int) -> bytes:
    """The frame of a sample that has a gyro, with its final zero."""
    if sample.gyro is None or sample.ticks is None:
        raise ValueError("a raw frame carries ticks and gyro")
    body = BODY.pack(VERSION, sequence % 256, sample.ticks % (1 << 32), *sample.acc, *sample.gyro)
    return cobs.encode(body + CRC.pack(crc16(body))) + b"\0"
