"""Frames out of a byte stream, by the delimiter that ends them."""

from __future__ import annotations

from collections import Counter


class Splitter:
    """Cuts a stream at a delimiter byte. Frames longer than ``limit`` are dropped and counted as ``overlong``.

    Empty frames are passed over: some senders put a delimiter before a frame as well as behind it.
    """

    def __init__(self, delimiter: bytes, limit: int, drops: Counter[str]) -> None:
        self._delimiter = delimiter
        self._limit = limit
        self._drops = drops
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes]:
        """The frames that end in these bytes, without their delimiter."""
        *ended, rest = (self._rest + data).split(self._delimiter)
        frames = []
        for frame in ended:
            if self._skipping or len(frame) > self._limit:
                self._drops["overlong"] += 1
                self._skipping = False
            elif frame:
                frames.append(frame)
        # Only the fact that it is too long is kept of an endless frame.
        self._skipping = self._skipping or len(rest) > self._limit
        self._rest = b"" if self._skipping else rest
        return frames
