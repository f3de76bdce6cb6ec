"""One picture, and where pictures come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from foottrack_service.camera.rig import Intrinsics

Gray = npt.NDArray[np.uint8]
DepthMap = npt.NDArray[np.uint16]


@dataclass(frozen=True)
class Frame:
    """A picture with the depth that belongs to its pixels.

    `gray` (h, w) uint8; `depth` (h, w) uint16 in `depth_unit` metres along the optical axis, 0 where unknown, or
    None; `t` bus-clock ns at mid-exposure of the *middle row*; `exposure` s; `readout` s from the first row's
    exposure to the last's (0: global shutter); `number` counts what the device took, so a gap is a lost picture.
    """

    gray: Gray
    depth: DepthMap | None
    t: int
    number: int
    exposure: float = 0.0
    readout: float = 0.0
    depth_unit: float = 0.001

    def row_time(self, row: float) -> int:
        """Bus-clock ns of mid-exposure of one row (a fraction is fine)."""
        rows = int(self.gray.shape[0])
        return self.t + round((row - 0.5 * (rows - 1)) / max(rows - 1, 1) * self.readout * 1e9)


class SourceError(Exception):
    """A camera could not be opened, or went away. The text says what to do about it."""


class SourceEnded(Exception):
    """A recorded sequence has no more pictures."""


class Source(Protocol):
    """Anything that delivers pictures, one after the other. Opened by its constructor."""

    @property
    def intrinsics(self) -> Intrinsics:
        """Of the pictures as delivered."""

    def read(self) -> Frame:
        """The next picture; waits for it at most about a second. Raises SourceError, SourceEnded."""

    def close(self) -> None:
        """Let the device go. May be called twice."""
