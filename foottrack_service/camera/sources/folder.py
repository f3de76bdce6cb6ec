"""A recorded RGB-D sequence in the layout of TUM's RGB-D benchmark (Sturm et al., IROS 2012).

``rgb.txt`` and ``depth.txt`` list ``timestamp path`` a line, ``#`` begins a comment; depth pictures are 16 bit, one
metre is 5000. Colour and depth that are at most 20 ms apart belong together. A picture may also be an array in numpy's
format (``.npy``), which is mapped into memory, once: it needs no decoding, and costs what a camera's picture does.
"""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from foottrack_service.camera.frame import DepthMap, Frame, SourceEnded, SourceError
from foottrack_service.camera.rig import Intrinsics

_TOGETHER_S = 0.02
_MAPPED = 4096
"""Arrays that stay mapped; an operating system allows some 65,000."""


class FolderSource:
    """Reads a sequence, as fast as it is read, or with `now` (bus clock, ns) at its own pace from the first one on.

    At its own pace pictures that are due while nobody reads are missing, as their numbers show.
    """

    def __init__(
        self,
        path: Path,
        intrinsics: Intrinsics,
        exposure: float,
        depth_scale: float = 5000.0,
        now: Callable[[], int] | None = None,
        loop: bool = False,
    ) -> None:
        """Raises SourceError when there is no such sequence."""
        self.intrinsics = intrinsics
        self._path, self._unit, self._exposure, self._loop, self._now = path, 1.0 / depth_scale, exposure, loop, now
        self._colour = _read_list(path / "rgb.txt")
        self._depth = _read_list(path / "depth.txt") if (path / "depth.txt").exists() else []
        if not self._colour:
            raise SourceError(f"{path / 'rgb.txt'} lists no pictures")
        self._shift: int | None = 0 if now is None else None
        self._next = 0
        self._mapped = lru_cache(_MAPPED)(_map)

    def read(self) -> Frame:
        """The next picture. Raises SourceEnded, and SourceError for a picture that cannot be read."""
        if not self._has(self._next):
            raise SourceEnded(f"{self._path} has {len(self._colour)} pictures")
        if self._shift is None and self._now is not None:
            self._shift = self._now() - round(self._colour[0][0] * 1e9)
        if self._now is not None:
            # As a camera does: who comes late has missed pictures.
            while self._has(self._next + 1) and self._taken(self._next + 1) <= self._now():
                self._next += 1
        number, self._next = self._next, self._next + 1
        stamp, name = self._colour[number % len(self._colour)]
        t = self._taken(number)
        gray = self._pixels(self._path / name, cv2.IMREAD_GRAYSCALE)
        if gray is None or gray.dtype != np.uint8 or gray.ndim != 2:
            raise SourceError(f"{self._path / name} is no picture")
        if gray.shape != (self.intrinsics.height, self.intrinsics.width):
            size = f"{gray.shape[1]}x{gray.shape[0]}"
            raise SourceError(f"{name} is {size} px, the lens was calibrated for another size")
        frame = Frame(np.asarray(gray, np.uint8), self._depth_near(stamp), t, number, self._exposure, 0.0, self._unit)
        if self._now is not None:
            time.sleep(max(0.0, (t - self._now()) * 1e-9))
        return frame

    def close(self) -> None:
        """Let go of the mapped arrays."""
        self._mapped.cache_clear()

    def _has(self, number: int) -> bool:
        return self._loop or number < len(self._colour)

    def _taken(self, number: int) -> int:
        """Bus-clock ns at which a picture is taken, rounds counted on."""
        rounds, index = divmod(number, len(self._colour))
        return round((self._colour[index][0] + rounds * self._duration()) * 1e9) + (self._shift or 0)

    def _duration(self) -> float:
        """Of one round, the gap to the next included."""
        first, last = self._colour[0][0], self._colour[-1][0]
        return (last - first) * len(self._colour) / max(len(self._colour) - 1, 1) or 1.0

    def _depth_near(self, stamp: float) -> DepthMap | None:
        at = bisect_left(self._depth, (stamp, ""))
        near = min(self._depth[max(at - 1, 0) : at + 1], key=lambda entry: abs(entry[0] - stamp), default=None)
        if near is None or abs(near[0] - stamp) > _TOGETHER_S:
            return None
        depth = self._pixels(self._path / near[1], cv2.IMREAD_UNCHANGED)
        if depth is None or depth.dtype != np.uint16 or depth.ndim != 2:
            raise SourceError(f"{self._path / near[1]} is no 16 bit depth picture")
        return np.asarray(depth, np.uint16)

    def _pixels(self, path: Path, mode: int) -> npt.NDArray[Any] | None:
        return self._mapped(path) if path.suffix == ".npy" else cv2.imread(str(path), mode)


def _map(path: Path) -> npt.NDArray[Any] | None:
    try:
        # Copy on write: a picture like any other to compiled kernels, which tell arrays apart that cannot be written.
        return np.asarray(np.load(path, mmap_mode="c"))
    except (OSError, ValueError):
        return None


def _read_list(path: Path) -> list[tuple[float, str]]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}; expected TUM's layout with rgb.txt in it") from error
    entries = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        stamp, _, name = line.strip().partition(" ")
        try:
            entries.append((float(stamp), name.strip()))
        except ValueError:
            raise SourceError(f"{path}, line {number}: {stamp!r} is no time stamp") from None
        if not name.strip() or not np.isfinite(entries[-1][0]):
            raise SourceError(f"{path}, line {number}: expected a time stamp and a file name")
    return sorted(entries)
