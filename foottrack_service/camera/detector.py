"""Finds tags in a picture, or in the window of it where one is expected.

A window is cut, enlarged when the tag is small, thresholded once, and its corners are refined to a fraction of a
pixel. The whole picture is searched with several thresholds, which costs ten times as much: only to (re)acquire.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from foottrack_service.camera.frame import Gray
from foottrack_service.rotations import Array

UPSCALE_BELOW_PX = 30.0
"""Tags smaller than this are looked for in a window enlarged to twice its size."""
_MIN_SIDE_PX = 10.0


@dataclass(frozen=True)
class Window:
    """Part of a picture, px, left and top inside, right and bottom outside; `tag_px` is the side expected there."""

    left: int
    top: int
    right: int
    bottom: int
    tag_px: float


@dataclass(frozen=True)
class Detection:
    """A tag in the picture: `corners` (4, 2) px in OpenCV's order, pixel centres at integers."""

    id: int
    corners: Array

    @property
    def side_px(self) -> float:
        """Mean length of its edges, px."""
        return float(np.linalg.norm(self.corners - np.roll(self.corners, 1, axis=0), axis=1).mean())


class TagDetector:
    """Looks for the given ids of one dictionary. Not for two threads at once."""

    def __init__(self, dictionary: Any, ids: Iterable[int]) -> None:
        self._ids = frozenset(ids)
        self._whole, self._narrow = _parameters(0.3), _parameters(0.45)
        # Twice OpenCV's samples a cell, and all the correction the dictionary allows: a 3x3 tag of 6 cm at 1.5 m
        # with 8 px of blur is then found in 90 % instead of 47 %, a 4x4 in 25 % instead of 3 %. In a window where
        # one of few ids is expected, that is safe; in the whole picture it would not be.
        self._narrow.perspectiveRemovePixelPerCell = 8
        self._narrow.perspectiveRemoveIgnoredMarginPerCell = 0.25
        self._narrow.errorCorrectionRate = 1.0
        self._search = cv2.aruco.ArucoDetector(dictionary, self._whole)
        self._look = cv2.aruco.ArucoDetector(dictionary, self._narrow)

    def search(self, gray: Gray) -> list[Detection]:
        """All tags of the whole picture (h, w), each id at most once: the largest of it."""
        rate = 4.0 * _MIN_SIDE_PX / max(gray.shape)
        self._whole.minMarkerPerimeterRate = rate
        self._search.setDetectorParameters(self._whole)
        return self._detect(self._search, gray)

    def look(self, gray: Gray, window: Window) -> list[Detection]:
        """The tags in a window of the picture, as `search` would describe them."""
        part = gray[window.top : window.bottom, window.left : window.right]
        if min(part.shape) < _MIN_SIDE_PX:
            return []
        scale = 2 if window.tag_px < UPSCALE_BELOW_PX else 1
        if scale > 1:
            part = np.asarray(cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), np.uint8)
        side = scale * window.tag_px
        # One threshold over more than the tag: narrower ones follow the blur, and lose what it has smeared.
        size = int(min(max(1.5 * side, 9.0), 151.0)) | 1
        self._narrow.adaptiveThreshWinSizeMin = self._narrow.adaptiveThreshWinSizeMax = size
        self._narrow.minMarkerPerimeterRate = max(0.01, 4.0 * 0.4 * side / max(part.shape))
        self._narrow.maxMarkerPerimeterRate = max(4.0, 4.0 * 2.5 * side / max(part.shape))
        self._look.setDetectorParameters(self._narrow)
        return self._detect(self._look, part, 1.0 / scale, window.left, window.top)

    def _detect(self, detector: Any, part: Gray, size: float = 1.0, left: int = 0, top: int = 0) -> list[Detection]:
        """The tags in a part of a picture that begins at `left`, `top`, whose pixels are `size` of the picture's."""
        corners, ids, _ = detector.detectMarkers(part)
        if ids is None:
            return []
        x, y = left + 0.5 * size - 0.5, top + 0.5 * size - 0.5
        largest: dict[int, Detection] = {}
        for tag_id, four in zip(ids.reshape(-1).tolist(), corners, strict=True):
            if tag_id not in self._ids:
                continue
            # Plain floats: numpy's arithmetic on eight numbers costs more than finding out where it is cheap.
            found = Detection(tag_id, np.array([(x + size * u, y + size * v) for u, v in four.reshape(4, 2).tolist()]))
            known = largest.get(tag_id)
            if known is None or found.side_px > known.side_px:
                largest[tag_id] = found
        return list(largest.values())


def _parameters(neighbourhood: float) -> Any:
    """OpenCV's defaults, with corners of the tags that were recognised (no candidate's) refined to sub-pixel."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    # Half the side of a corner's neighbourhood over a cell's: nothing but the corner itself may be in it.
    parameters.relativeCornerRefinmentWinSize = neighbourhood
    parameters.cornerRefinementWinSize = 5
    parameters.cornerRefinementMinAccuracy = 0.01
    return parameters
