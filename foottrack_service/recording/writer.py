"""Records what arrives, by a thread of its own: the caller's loop never waits for a disk."""

from __future__ import annotations

import logging
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from foottrack_service.recording.errors import DiskFullError, RecordingError
from foottrack_service.recording.file import Opener, RecordingFile

FLUSH_S = 0.5
"""Between flushes. A kill loses at most the last second; the other half is for a slow disk."""
DRAIN_S = 0.02
"""Between looks at the queue: short, so that a batch is small and the interpreter's lock is soon free again."""
QUEUE_BYTES = 64 * 1024 * 1024
"""What may wait for the disk; a message more is dropped, and counted."""
RESERVE_BYTES = 64 * 1024 * 1024
"""Space that is left on the disk: when there is less, the recording is ended while it still can be."""
MESSAGE_OVERHEAD_BYTES = 256
"""What a waiting message costs beside its payload."""

_log = logging.getLogger(__name__)

FreeBytes = Callable[[Path], int]


class WriterStats(NamedTuple):
    """What became of the messages."""

    accepted: int
    written: int
    dropped: int
    """The queue was full, or the recording had ended."""
    file_bytes: int


class RecordingWriter:
    """Writes a recording to ``path`` (``<path>.part`` until it is closed).

    ``config_toml`` are the settings that results depend on; ``clock`` gives ns of the bus clock. ``on_error`` is called
    by the writing thread when the recording ends before ``close``: DiskFullError (the file is whole) or another
    RecordingError; ``error`` has it too. Raises RecordingError when the file cannot be made, DiskFullError when there
    is too little space to begin.
    """

    def __init__(
        self,
        path: Path,
        config_toml: str,
        clock: Callable[[], int],
        *,
        on_error: Callable[[RecordingError], None] | None = None,
        free_bytes: FreeBytes | None = None,
        opener: Opener | None = None,
        queue_bytes: int = QUEUE_BYTES,
        reserve_bytes: int = RESERVE_BYTES,
    ) -> None:
        self.path = path
        self.error: RecordingError | None = None
        self._on_error = on_error
        self._free_bytes = free_bytes or _free_bytes
        self._queue_bytes = queue_bytes
        self._reserve_bytes = reserve_bytes
        self._queue: deque[tuple[bytes, bytes, int, int, int]] = deque()
        # Each counter has one writer, so none needs a lock.
        self._bytes_in = 0
        self._bytes_out = 0
        self._accepted = 0
        self._dropped = 0
        try:
            self._check_space()
        except OSError as error:
            raise RecordingError(path, f"cannot be written: {error.strerror or error}") from None
        self._file = RecordingFile(path, config_toml, clock(), opener)
        self._file_bytes = 0
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"recorder {path.name}", daemon=True)
        self._thread.start()

    def write(self, topic: bytes, payload: bytes, arrival: int, publish_time: int, sequence: int) -> bool:
        """Hand a message over; never waits. False when it was dropped. To be called by one thread only."""
        size = len(payload) + MESSAGE_OVERHEAD_BYTES
        if self._bytes_in - self._bytes_out + size > self._queue_bytes or self._stopping.is_set():
            self._dropped += 1
            return False
        self._bytes_in += size
        self._accepted += 1
        self._queue.append((topic, payload, arrival, publish_time, sequence))
        return True

    def close(self) -> None:
        """Write the rest, finish the file and rename it. Waits for the disk. Raises what ended the recording badly.

        A recording that was ended for a full disk is whole and does not raise; ``error`` says so.
        """
        self._stopping.set()
        self._thread.join()
        if self.error is not None and not isinstance(self.error, DiskFullError):
            raise self.error

    @property
    def stats(self) -> WriterStats:
        """Counts so far."""
        written = self._file.messages
        abandoned = 0 if self._thread.is_alive() else self._accepted - written
        return WriterStats(self._accepted, written, self._dropped + abandoned, self._file_bytes)

    def _run(self) -> None:
        try:
            self._write_until_stopped()
            self._file.finish()
        except RecordingError as error:
            self._fail(error)
        except Exception as error:
            _log.exception("the recorder of %s failed", self.path)
            self._file.abandon()
            self._fail(RecordingError(self._file.part, f"{type(error).__name__}: {error}"))

    def _write_until_stopped(self) -> None:
        last_flush = time.monotonic()
        self._file.flush()
        while not self._stopping.wait(DRAIN_S):
            self._drain()
            now = time.monotonic()
            if now - last_flush >= FLUSH_S:
                self._file.flush()
                last_flush = now
            self._file_bytes = self._file.bytes_written
            try:
                self._check_space()
            except DiskFullError:
                self._file.finish()
                raise
        self._drain()

    def _drain(self) -> None:
        queue, add = self._queue, self._file.add
        for _ in range(len(queue)):
            message = queue.popleft()
            self._bytes_out += len(message[1]) + MESSAGE_OVERHEAD_BYTES
            add(*message)

    def _check_space(self) -> None:
        free = self._free_bytes(self.path.parent)
        if free < self._reserve_bytes:
            raise DiskFullError(
                self.path, f"the disk is nearly full ({free >> 20} MiB left, {self._reserve_bytes >> 20} are kept free)"
            )

    def _fail(self, error: RecordingError) -> None:
        self._stopping.set()
        self.error = error
        _log.error("recording ended: %s", error)
        if self._on_error is not None:
            self._on_error(error)


def _free_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).free
