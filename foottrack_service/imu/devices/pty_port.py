"""A serial port made of a pty (POSIX): what is opened is ``port``, a simulated device holds the other end."""

from __future__ import annotations

import os
import sys
from types import TracebackType
from typing import Self

if sys.platform != "win32":
    import pty
    import termios
    import tty


class PtyPort:
    """The device's end. Raises OSError on Windows, which has no ptys."""

    def __init__(self) -> None:
        if sys.platform == "win32":
            raise OSError("Windows has no ptys")
        self._device_end, self._host_end = pty.openpty()
        tty.setraw(self._host_end, termios.TCSANOW)
        os.set_blocking(self._device_end, False)
        self.port = os.ttyname(self._host_end)

    def fileno(self) -> int:
        """For an event loop that waits for the host's bytes."""
        return self._device_end

    def write(self, data: bytes) -> int:
        """What the device sends; says how much of it the line took: nobody may be reading."""
        try:
            return os.write(self._device_end, data)
        except BlockingIOError:
            return 0

    def read(self) -> bytes:
        """What the host sent so far."""
        try:
            return os.read(self._device_end, 65536)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        """Unplug it."""
        for end in (self._device_end, self._host_end):
            if end >= 0:
                os.close(end)
        self._device_end = self._host_end = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
