"""What can go wrong with a recording.

::

    RecordingError          the file cannot be read or written; ``offset`` says where
    ├── DiskFullError       the recording was ended, properly, before the disk was full
    ├── WriteError          the system refused the bytes: what was flushed before can be recovered
    └── ReplayRefusedError  somebody publishes the same topics live
"""

from __future__ import annotations

from pathlib import Path


class RecordingError(Exception):
    """A recording that is damaged, is none, or cannot be written.

    Attributes: ``path``; ``offset`` of the trouble in the file, bytes, or None.
    """

    def __init__(self, path: Path, detail: str, offset: int | None = None) -> None:
        super().__init__(f"{path}" + (f", byte {offset}" if offset is not None else "") + f": {detail}")
        self.path = path
        self.detail = detail
        self.offset = offset


class DiskFullError(RecordingError):
    """The disk was about to be full; the recording is whole up to here."""


class WriteError(RecordingError):
    """The system refused the bytes (no space although it had said so, a disk pulled out)."""


class ReplayRefusedError(RecordingError):
    """Played as asked, two sources would speak on one topic. Attribute: ``topics``."""

    def __init__(self, path: Path, topics: list[str]) -> None:
        shown = ", ".join(topics[:4]) + (", ..." if len(topics) > 4 else "")
        super().__init__(path, f"{shown} is published live: play it as another user, or leave these streams out")
        self.topics = topics
