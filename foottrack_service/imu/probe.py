"""What is at the other end of a serial port: listen at each baud rate, and try to wake a BNO08x."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from typing import NamedTuple

from foottrack_service.bus.clock import now
from foottrack_service.imu.formats import SERIAL_FORMATS, sh2
from foottrack_service.imu.formats.guess import guess_format
from foottrack_service.imu.formats.shtp import Channel, ShtpSender
from foottrack_service.imu.line import open_line

LISTEN_S = 0.6
"""A BNO08x needs a few tenths of it to restart; at 100 Hz it is 60 samples."""


class Probed(NamedTuple):
    """What was found: a format and its baud rate, or neither, and how many bytes came at all."""

    format: str | None
    baud: int | None
    heard: int


async def probe(port: str, listen_s: float = LISTEN_S) -> Probed:
    """Try one port; it must not be in use. Raises OSError where it cannot be opened."""
    heard = 0
    for baud in sorted({known.baud for known in SERIAL_FORMATS.values()}):
        data = await _listen(port, baud, listen_s)
        heard += len(data)
        found = guess_format(data)
        if found is not None:
            return Probed(found, baud, heard)
    return Probed(None, None, heard)


async def _listen(port: str, baud: int, listen_s: float) -> bytes:
    data = bytearray()
    arrived, lost = asyncio.Event(), asyncio.Event()

    def on_data(chunk: bytes, t_arr: int) -> None:
        data.extend(chunk)
        arrived.set()

    def on_lost(reason: str) -> None:
        lost.set()
        arrived.set()

    line = await open_line(port, baud, on_data, on_lost, now)
    try:
        shtp = SERIAL_FORMATS["bno08x"]
        if baud == shtp.baud:
            for byte in ShtpSender().frame(Channel.EXECUTABLE, sh2.RESET):
                line.write(bytes([byte]))
                await asyncio.sleep(shtp.byte_gap_s)
        with suppress(TimeoutError):
            async with asyncio.timeout(listen_s):
                while not lost.is_set() and guess_format(bytes(data)) is None:
                    arrived.clear()
                    await arrived.wait()
    finally:
        await line.close()
    return bytes(data)
