"""Single keys from the terminal while an event loop runs."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

POLL_S = 0.05
_POSIX_KEYS = {"\x1b[C": "right", "\x1b[D": "left", "\x1b[A": "up", "\x1b[B": "down"}
_WINDOWS_KEYS = {"M": "right", "K": "left", "H": "up", "P": "down"}


@contextmanager
def keys(handle: Callable[[str], None]) -> Iterator[bool]:
    """Calls ``handle`` in the running event loop with each key: a character, or "left", "right", "up", "down".

    Gives whether keys are read at all: not where standard input is no terminal. The terminal is as before afterwards.
    """
    if not sys.stdin.isatty():
        yield False
    elif sys.platform == "win32":
        with _windows_keys(handle):
            yield True
    else:
        with _posix_keys(handle):
            yield True


def split_keys(text: str) -> list[str]:
    """Keys in what a POSIX terminal sent at once."""
    found = []
    while text:
        sequence = next((begin for begin in _POSIX_KEYS if text.startswith(begin)), None)
        found.append(_POSIX_KEYS[sequence] if sequence else text[0])
        text = text[len(sequence) if sequence else 1 :]
    return found


if sys.platform != "win32":
    import os
    import termios
    import tty

    @contextmanager
    def _posix_keys(handle: Callable[[str], None]) -> Iterator[None]:
        descriptor = sys.stdin.fileno()
        before = termios.tcgetattr(descriptor)
        loop = asyncio.get_running_loop()

        def read() -> None:
            text = os.read(descriptor, 64).decode(errors="ignore")
            if not text:  # the terminal is gone
                loop.remove_reader(descriptor)
            for key in split_keys(text):
                handle(key)

        tty.setcbreak(descriptor)
        loop.add_reader(descriptor, read)
        try:
            yield
        finally:
            loop.remove_reader(descriptor)
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)

else:
    import msvcrt

    @contextmanager
    def _windows_keys(handle: Callable[[str], None]) -> Iterator[None]:
        loop = asyncio.get_running_loop()
        stopping = threading.Event()

        def read() -> None:
            while not stopping.wait(POLL_S):
                while msvcrt.kbhit():
                    key = msvcrt.getwch()
                    if key in ("\x00", "\xe0"):
                        key = _WINDOWS_KEYS.get(msvcrt.getwch(), "")
                    loop.call_soon_threadsafe(handle, key)

        reader = threading.Thread(target=read, name="keys", daemon=True)
        reader.start()
        try:
            yield
        finally:
            stopping.set()
            reader.join()
