"""SHTP over UART, the transport of the BNO08x: cargoes of (channel, sequence number, payload), between 0x7E flags.

A frame is 7E, protocol id, escaped bytes, 7E; in it 7D introduces an escaped byte (xor 0x20). Protocol 1 is SHTP, whose
header is length (uint16 LE with the header, top bit: continuation), channel, sequence number. Protocol 0 tells how much
the device can take. There is no checksum. Sources: the BNO08x data sheet, 1.3.3 and 1.4.1; the SHTP manual.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

from foottrack_service.imu.formats.framing import Splitter

FLAG, ESCAPE = b"\x7e", b"\x7d"
PROTOCOL_CONTROL, PROTOCOL_SHTP = 0, 1
HEADER = struct.Struct("<HBB")

_LONGEST = 2048


class Channel(IntEnum):
    """Channels of the BNO08x; WAKE is that of sensors that wake the host, GYRO_ROTATION has no report ids."""

    COMMAND = 0
    EXECUTABLE = 1
    CONTROL = 2
    INPUT = 3
    WAKE = 4
    GYRO_ROTATION = 5


class Cargo(NamedTuple):
    """One whole cargo."""

    channel: Channel
    sequence: int
    payload: bytes


class ShtpReceiver:
    """Bytes to cargoes. Drops: ``escape``, ``protocol``, ``header``, ``channel``, ``fragment`` (long cargoes come in
    parts; those that this project reads never do), ``overlong``; ``lost`` counts gaps in a channel's sequence."""

    def __init__(self, drops: Counter[str]) -> None:
        self._drops = drops
        self._splitter = Splitter(FLAG, _LONGEST, drops)
        self._sequence: dict[Channel, int] = {}

    def feed(self, data: bytes) -> Iterator[Cargo]:
        """The cargoes that are whole with these bytes, one at a time: the reader may ``restart`` in between."""
        for frame in self._splitter.feed(data):
            cargo = self._parse(frame)
            if isinstance(cargo, str):
                self._drops[cargo] += 1
            elif cargo is not None:
                yield cargo

    def restart(self) -> None:
        """The device started again: its sequence numbers do too."""
        self._sequence.clear()

    def _parse(self, frame: bytes) -> Cargo | str | None:
        """The cargo, or why there is none; None for what is nobody's loss."""
        if ESCAPE in frame:
            unescaped = _unescape(frame)
            if unescaped is None:
                return "escape"
            frame = unescaped
        if frame[0] == PROTOCOL_CONTROL:
            return None
        if frame[0] != PROTOCOL_SHTP:
            return "protocol"
        if len(frame) < 1 + HEADER.size:
            return "header"
        length, channel_number, sequence = HEADER.unpack_from(frame, 1)
        if channel_number > Channel.GYRO_ROTATION:
            return "channel"
        channel = Channel(channel_number)
        before = self._sequence.get(channel)
        if length != len(frame) - 1:
            # A first part names the whole's length, a later one has the top bit.
            if length > len(frame) - 1 and channel == Channel.COMMAND:
                self._sequence[channel] = sequence
                return "fragment"
            return "header"
        self._sequence[channel] = sequence
        missing = 0 if before is None else (sequence - before - 1) % 256
        # A count that goes back is that of a device that started anew.
        if 0 < missing < 128:
            self._drops["lost"] += missing
        return Cargo(channel, sequence, frame[1 + HEADER.size :])


class ShtpSender:
    """Payloads to frames, each channel with its own sequence."""

    def __init__(self) -> None:
        self._sequence: Counter[int] = Counter()

    def frame(self, channel: Channel, payload: bytes) -> bytes:
        """One cargo, framed and escaped."""
        header = HEADER.pack(HEADER.size + len(payload), channel, self._sequence[channel] % 256)
        self._sequence[channel] += 1
        # The escape first, or it would escape its own escapes.
        escaped = (header + payload).replace(ESCAPE, b"\x7d\x5d").replace(FLAG, b"\x7d\x5e")
        return FLAG + bytes([PROTOCOL_SHTP]) + escaped + FLAG


def _unescape(frame: bytes) -> bytes | None:
    first, *escaped = frame.split(ESCAPE)
    out = bytearray(first)
    for part in escaped:
        if not part:
            return None
        out.append(part[0] ^ 0x20)
        out += part[1:]
    return bytes(out) or None
