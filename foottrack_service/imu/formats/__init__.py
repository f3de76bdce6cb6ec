"""What the bytes of each device mean. One interface, ``Decoder``, for all that come over a serial line."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from foottrack_service.imu.formats.ascii import AsciiDecoder
from foottrack_service.imu.formats.bno08x import Bno08xDecoder
from foottrack_service.imu.formats.raw import RawDecoder
from foottrack_service.imu.formats.rvc import RvcDecoder
from foottrack_service.imu.sample import Decoder


class SerialFormat(NamedTuple):
    """A format that comes over a serial line."""

    decoder: Callable[[], Decoder]
    baud: int
    byte_gap_s: float = 0.0
    """Pause that the device needs between two bytes from the host."""


SERIAL_FORMATS = {
    "ascii": SerialFormat(AsciiDecoder, 115_200),
    "rvc": SerialFormat(RvcDecoder, 115_200),
    # The data sheet wants 100 us; USB adapters join what is written within the same millisecond.
    "bno08x": SerialFormat(Bno08xDecoder, 3_000_000, byte_gap_s=1e-3),
    "raw": SerialFormat(RawDecoder, 921_600),
}
