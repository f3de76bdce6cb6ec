"""Msgpack in forms that our own encoder never writes and that every receiver must read."""

from __future__ import annotations

import struct
from typing import Any

ENVELOPE: dict[str, Any] = {
    "v": 1,
    "src": "golden",
    "sid": "5d41402a",
    "seq": 7,
    "t": 1234567000000,
    "t_pub": 1234567890999,
    "valid": True,
}
"""What all golden messages have in common."""


def widest(value: Any) -> bytes:
    """Each value in the longest form that msgpack has for it."""
    match value:
        case None:
            return b"\xc0"
        case bool():
            return b"\xc3" if value else b"\xc2"
        case int():
            return b"\xd3" + struct.pack(">q", value)
        case float():
            return b"\xcb" + struct.pack(">d", value)
        case str():
            raw = value.encode()
            return b"\xdb" + struct.pack(">I", len(raw)) + raw
        case bytes():
            return b"\xc6" + struct.pack(">I", len(value)) + value
        case list():
            return b"\xdd" + struct.pack(">I", len(value)) + b"".join(widest(item) for item in value)
        case dict():
            items = b"".join(widest(key) + widest(item) for key, item in value.items())
            return b"\xdf" + struct.pack(">I", len(value)) + items
    raise TypeError(type(value).__name__)


def nested_arrays(levels: int) -> bytes:
    """So many arrays inside one another, the innermost empty."""
    return b"\x91" * (levels - 1) + b"\x90"
