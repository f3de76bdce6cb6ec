"""Finds calibration boards in pictures: chessboards, and ChArUco boards, which may be partly hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np

from foottrack_service.camera.dictionaries import load_dictionary
from foottrack_service.camera.frame import Gray
from foottrack_service.rotations import Array

_LEAST_CORNERS = 8
_CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)


@dataclass(frozen=True)
class View:
    """One board in one picture: `model` (n, 3) m in the board's frame, `image` (n, 2) px."""

    model: Array
    image: Array


@dataclass(frozen=True)
class Chessboard:
    """`columns` x `rows` *inner* corners, squares of `square` m.

    `refine_px` is half the side of the neighbourhood in which a corner is refined. None takes 0.4 of the least distance
    between corners, 11 at most. A fixed 11, as in OpenCV's own example, reaches other corners in slanted views: on its
    13 photos 0.41 px rms and fx 536.1, as it publishes, instead of 0.18 and 533.3, all by one view that then misses by
    1.2 px. On drawn views of a known lens 0.4 finds fx within 0.2 px, 0.55 misses by up to 12, and 11 has 1.1 px rms.
    """

    columns: int
    rows: int
    square: float
    refine_px: int | None = None

    def find(self, gray: Gray) -> View | None:
        """The whole board, corners refined; None when a part of it is missing."""
        size = (self.columns, self.rows)
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH + cv2.CALIB_CB_NORMALIZE_IMAGE
        found, corners = cv2.findChessboardCorners(gray, size, flags=flags)
        if not found:
            return None
        points = np.asarray(corners, dtype=np.float32).reshape(-1, 1, 2)
        half = self.refine_px
        if half is None:
            grid_px = points.reshape(self.rows, self.columns, 2)
            pitch = min(np.linalg.norm(np.diff(grid_px, axis=axis), axis=2).min() for axis in (0, 1))
            half = int(np.clip(0.4 * pitch, 2, 11))
        refined = cv2.cornerSubPix(gray, points, (half, half), (-1, -1), _CRITERIA)
        grid = np.mgrid[0 : self.columns, 0 : self.rows].T.reshape(-1, 2) * self.square
        model = np.column_stack([grid, np.zeros(len(grid))])
        return View(model, np.asarray(refined, dtype=np.float64).reshape(-1, 2))


@dataclass(frozen=True)
class CharucoBoard:
    """`columns` x `rows` squares of `square` m with tags of `marker` m in the white ones."""

    columns: int
    rows: int
    square: float
    marker: float
    dictionary: str | Sequence[str]

    @cached_property
    def _detector(self) -> Any:
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows), self.square, self.marker, load_dictionary(self.dictionary)
        )
        return board, cv2.aruco.CharucoDetector(board)

    def find(self, gray: Gray) -> View | None:
        """The corners that are seen; None when there are fewer than 8, or all in one line."""
        board, detector = self._detector
        corners, ids, _, _ = detector.detectBoard(gray)
        if ids is None or len(ids) < _LEAST_CORNERS:
            return None
        indices = np.asarray(ids).reshape(-1)
        model = np.asarray(board.getChessboardCorners(), dtype=np.float64).reshape(-1, 3)[indices]
        if min(np.ptp(model[:, 0]), np.ptp(model[:, 1])) < 0.5 * self.square:
            return None
        return View(model, np.asarray(corners, dtype=np.float64).reshape(-1, 2))


Board = Chessboard | CharucoBoard
