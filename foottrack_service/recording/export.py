"""A recording in other formats: bare msgpack, JSON lines, and CSV with a table a topic."""

from __future__ import annotations

import base64
import csv
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import msgpack

from foottrack_service.recording.bare import to_bare
from foottrack_service.recording.recording import Frame

_AXES = {3: ("x", "y", "z"), 4: ("x", "y", "z", "w"), 6: ("xx", "xy", "xz", "yy", "yz", "zz")}
"""The wire's vectors, quaternions and covariances by their length."""


def as_map(frame: Frame) -> dict[str, Any]:
    """``{"topic", "log_time", ...envelope}``."""
    return {"topic": frame.topic.decode(), "log_time": frame.arrival, **msgpack.unpackb(frame.payload)}


def to_json(frame: Frame) -> str:
    """One line of JSON; bytes are base64."""
    return json.dumps(as_map(frame), ensure_ascii=False, allow_nan=False, default=_base64)


def write_msgpack(frames: Iterable[Frame], out: BinaryIO) -> int:
    """Write a bare stream, and say how many messages. ``import`` brings it back to the bit."""
    count = 0
    for frame in frames:
        out.write(to_bare(frame))
        count += 1
    return count


def write_jsonl(frames: Iterable[Frame], out: TextIO) -> int:
    """Write JSON lines, and say how many."""
    count = 0
    for frame in frames:
        out.write(to_json(frame) + "\n")
        count += 1
    return count


class CsvTables:
    """One table a topic in a folder, ``user_imu_left.csv``: nested keys with dots, vectors by axis, nil is empty.

    A table's columns are those of all its messages, so frames are seen twice: ``learn`` all, then ``write`` all.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._columns: dict[bytes, dict[str, None]] = {}

    def learn(self, frames: Iterable[Frame]) -> None:
        """Find the columns."""
        for frame in frames:
            self._columns.setdefault(frame.topic, {}).update(dict.fromkeys(_flat(as_map(frame))))

    def write(self, frames: Iterable[Frame]) -> int:
        """Write the rows, and say how many. Raises OSError."""
        self._folder.mkdir(parents=True, exist_ok=True)
        files: dict[bytes, TextIO] = {}
        tables: dict[bytes, csv.DictWriter[str]] = {}
        count = 0
        try:
            for topic, columns in self._columns.items():
                path = self._folder / (topic.decode().replace("/", "_") + ".csv")
                files[topic] = path.open("x", newline="", encoding="utf-8")
                tables[topic] = csv.DictWriter(files[topic], list(columns))
                tables[topic].writeheader()
            for frame in frames:
                tables[frame.topic].writerow(_flat(as_map(frame)))
                count += 1
        finally:
            for file in files.values():
                file.close()
        return count


def _flat(values: dict[str, Any]) -> dict[str, Any]:
    return dict(_leaves(values, ""))


def _leaves(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    if type(value) is dict:
        for key, below in value.items():
            yield from _leaves(below, f"{name}.{key}" if name else str(key))
    elif type(value) is list:
        axes = _AXES.get(len(value)) or tuple(str(index) for index in range(len(value)))
        for axis, below in zip(axes, value, strict=True):
            yield from _leaves(below, f"{name}.{axis}")
    elif value is not None:
        yield name, _base64(value) if type(value) is bytes else value


def _base64(value: Any) -> str:
    if not isinstance(value, bytes):
        raise TypeError(f"{type(value).__name__} has no place in JSON")
    return base64.b64encode(value).decode()
