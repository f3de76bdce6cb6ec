"""Raw streams of a recording as files: an IMU's bytes, and pictures in the layout of TUM's RGB-D benchmark."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any, BinaryIO

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Lens, RawImu, RawPicture, Side
from foottrack_protocol.topics import TOPICS, Role
from foottrack_service.recording.recording import Recording

CAMERA = "camera"
COLUMNS = ("t_ns", "bytes", "connection", "format", "source", "tracker")
"""Of the table beside an IMU's bytes: a row a read or datagram, in order."""

_LAYERS = {"gray": "rgb", "depth": "depth"}
"""The benchmark's names."""
_MOST_OPEN = 16
"""Layers that may wait for pieces: they come one right after the other."""


@dataclass(slots=True)
class ImuBytes:
    """One IMU's."""

    reads: int = 0
    bytes: int = 0
    formats: list[str] = field(default_factory=list)


@dataclass(slots=True)
class RawFiles:
    """What was written."""

    imu: dict[Side, ImuBytes] = field(default_factory=dict)
    pictures: int = 0
    depths: int = 0
    torn: int = 0
    """Pictures and depths of which a piece is missing."""
    other_lens: int = 0
    """Pictures of another lens than the first one's, left out: a sequence has one."""
    first: RawPicture | None = None

    @property
    def lens(self) -> Lens | None:
        """Of the pictures."""
        return None if self.first is None else self.first.lens


def raw_messages(recording: Recording, user: str | None = None) -> Iterator[Message]:
    """Raw messages, of one user or of all. Raises RecordingError."""
    for recorded in recording.messages():
        message = recorded.message
        topic = TOPICS.get(message.stream)
        if topic is not None and topic.role is Role.RAW and user in (None, message.user):
            yield message


def write_raw(recording: Recording, user: str, folder: Path) -> RawFiles:
    """Write ``imu-<side>.bin`` with a table ``imu-<side>.csv``, and ``camera/``. Raises RecordingError, OSError.

    Files that are there already are not overwritten: FileExistsError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = RawFiles()
    with ExitStack() as files:
        imus: dict[Side, _Imu] = {}
        camera: _Camera | None = None
        for message in raw_messages(recording, user):
            if isinstance(message.data, RawImu):
                side = next(side for side in SIDES if message.stream.endswith(side))
                if side not in imus:
                    imus[side] = _Imu(folder / f"imu-{side}", files)
                    found.imu[side] = imus[side].seen
                imus[side].add(message.t, message.data)
            else:
                camera = camera or _Camera(folder / CAMERA, files, found)
                camera.add(message)
        if camera is not None:
            camera.finish()
    return found


class _Imu:
    def __init__(self, base: Path, files: ExitStack) -> None:
        self.seen = ImuBytes()
        self._bytes: BinaryIO = files.enter_context(base.with_suffix(".bin").open("xb"))
        table = files.enter_context(base.with_suffix(".csv").open("x", newline="", encoding="utf-8"))
        self._rows = csv.writer(table)
        self._rows.writerow(COLUMNS)

    def add(self, t: int, raw: RawImu) -> None:
        self.seen.reads += 1
        self.seen.bytes += len(raw.bytes)
        if raw.format not in self.seen.formats:
            self.seen.formats.append(raw.format)
        self._bytes.write(raw.bytes)
        self._rows.writerow((t, len(raw.bytes), raw.connection, raw.format, raw.source, raw.tracker or ""))


class _Camera:
    def __init__(self, folder: Path, files: ExitStack, found: RawFiles) -> None:
        self._folder, self._found = folder, found
        self._open: dict[Any, dict[int, bytes]] = {}
        self._lists = {}
        for layer, name in _LAYERS.items():
            (folder / name).mkdir(parents=True, exist_ok=True)
            self._lists[layer] = files.enter_context((folder / f"{name}.txt").open("x", encoding="utf-8"))
            self._lists[layer].write("# timestamp filename\n")

    def add(self, message: Message) -> None:
        raw: RawPicture = message.data
        found = self._found
        if found.first is None:
            found.first = raw
        if raw.lens != found.lens:
            found.other_lens += raw.part == 0 and raw.layer == "gray"
            return
        key = (message.sid, message.t, raw.frame, raw.layer)
        pieces = self._open.setdefault(key, {})
        pieces[raw.part] = raw.png
        if len(pieces) == raw.parts:
            del self._open[key]
            self._write(message.t, raw.layer, b"".join(png for _, png in sorted(pieces.items())))
        elif len(self._open) > _MOST_OPEN:
            del self._open[next(iter(self._open))]
            found.torn += 1

    def finish(self) -> None:
        self._found.torn += len(self._open)

    def _write(self, t: int, layer: str, png: bytes) -> None:
        found = self._found
        number = found.pictures if layer == "gray" else found.depths
        name = f"{_LAYERS[layer]}/{number:06d}.png"
        (self._folder / name).write_bytes(png)
        self._lists[layer].write(f"{Decimal(t).scaleb(-9):f} {name}\n")
        if layer == "gray":
            found.pictures += 1
        else:
            found.depths += 1
