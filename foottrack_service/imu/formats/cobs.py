"""Consistent overhead byte stuffing (Cheshire and Baker 1999): a frame without zero bytes, so that zero can end it."""

from __future__ import annotations


def encode(data: bytes) -> bytes:
    """Without the final zero. At most one byte longer for each 254."""
    out = bytearray()
    for run in data.split(b"\0"):
        while len(run) >= 254:
            out += b"\xff" + run[:254]
            run = run[254:]
        out.append(len(run) + 1)
        out += run
    return bytes(out)


def decode(frame: bytes) -> bytes | None:
    """What was encoded, or None where the frame is damaged. ``frame`` comes without its final zero."""
    out = bytearray()
    at = 0
    while at < len(frame):
        code = frame[at]
        end = at + code
        if code == 0 or end > len(frame):
            return None
        out += frame[at + 1 : end]
        at = end
        if code < 255 and at < len(frame):
            out.append(0)
    return bytes(out)
