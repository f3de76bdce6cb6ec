"""Intrinsics of a camera from views of a board (Zhang 2000, through OpenCV), and when to refuse them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from foottrack_service.camera.boards import View
from foottrack_service.camera.rig import Intrinsics
from foottrack_service.rotations import Array

LEAST_VIEWS = 8
MOST_RMS_PX = 0.8
LEAST_COVERAGE = 0.6
LEAST_TILT_RAD = np.radians(25.0)
MOST_FOCAL_SIGMA = 0.01
"""Share of the focal length that its standard deviation may be."""

_ZONES = (3, 4)
_ZONE_NAMES = (("upper", "middle", "lower"), ("left", "centre left", "centre right", "right"))
_NEW_VIEW = 0.06


class CalibrationError(ValueError):
    """A set of views from which no camera should be calibrated; the text says what is missing."""


@dataclass(frozen=True)
class Calibration:
    """A lens with its evidence: `rms` px over all corners, `view_rms` px per view, `focal_sigma` px."""

    intrinsics: Intrinsics
    rms: float
    view_rms: tuple[float, ...]
    focal_sigma: float
    coverage: float
    tilt: float


def calibrate(
    views: Sequence[View], width: int, height: int, max_rms: float = MOST_RMS_PX, square_pixels: bool = False
) -> Calibration:
    """Intrinsics with five distortion coefficients; `square_pixels` keeps fx = fy.

    Raises CalibrationError: too few views, views that leave too much of the picture out or all look at the board at
    the same slant, a fit that is poor, or a focal length that they do not determine.
    """
    if len(views) < LEAST_VIEWS:
        raise CalibrationError(f"{len(views)} views show the board; {LEAST_VIEWS} are needed, 15 are better")
    share = float(covered(views, width, height).mean())
    if share < LEAST_COVERAGE:
        missing = "; ".join(coverage_hints(views, width, height))
        raise CalibrationError(f"the board was seen in {100 * share:.0f} % of the picture only: {missing}")
    models = [view.model.astype(np.float32).reshape(-1, 1, 3) for view in views]
    images = [view.image.astype(np.float32).reshape(-1, 1, 2) for view in views]
    start, flags = np.eye(3), 0
    if square_pixels:
        flags = int(cv2.CALIB_FIX_ASPECT_RATIO)
    try:
        rms, matrix, coefficients, rotvecs, _, sigmas, _, view_rms = cv2.calibrateCameraExtended(
            models, images, (width, height), start, np.zeros(5), flags=flags
        )
    except cv2.error as error:
        raise CalibrationError(f"OpenCV finds no camera that explains these views: {error.err}") from error
    sigma = float(np.asarray(sigmas).ravel()[:2].max())
    tilt = _tilt_spread([np.asarray(rotvec) for rotvec in rotvecs])
    if rms > max_rms:
        worst = int(np.argmax(view_rms))
        raise CalibrationError(
            f"corners miss by {rms:.2f} px rms, {max_rms:g} are allowed; view {worst + 1} is worst. Is the board flat,"
            " its size right, are the pictures sharp?"
        )
    if tilt < LEAST_TILT_RAD:
        raise CalibrationError(
            f"views differ in slant by {np.degrees(tilt):.0f} deg only: tilt the board to all sides, by 30 deg and more"
        )
    focal = float(matrix[0, 0])
    if not np.isfinite(sigma) or sigma > MOST_FOCAL_SIGMA * focal:
        raise CalibrationError(f"the focal length is known to {sigma:.1f} px only: take more views, more tilted")
    lens = Intrinsics(
        width,
        height,
        focal,
        float(matrix[1, 1]),
        float(matrix[0, 2]),
        float(matrix[1, 2]),
        tuple(float(c) for c in np.asarray(coefficients).ravel()[:5]),
    )
    return Calibration(lens, float(rms), tuple(np.asarray(view_rms).ravel().tolist()), sigma, share, tilt)


def covered(views: Sequence[View], width: int, height: int) -> Array:
    """Which of 3 x 4 zones of the picture have held a corner, (3, 4), 0 or 1."""
    zones = np.zeros(_ZONES)
    for view in views:
        rows = np.clip(view.image[:, 1] / height * _ZONES[0], 0, _ZONES[0] - 1).astype(int)
        columns = np.clip(view.image[:, 0] / width * _ZONES[1], 0, _ZONES[1] - 1).astype(int)
        zones[rows, columns] = 1.0
    return zones


def coverage_hints(views: Sequence[View], width: int, height: int) -> list[str]:
    """What to show the camera next, most useful first; empty when there is enough."""
    zones = covered(views, width, height)
    hints = [
        f"show the board at the {_ZONE_NAMES[0][row]} {_ZONE_NAMES[1][column]}"
        for row, column in np.argwhere(zones == 0.0)
    ]
    if len(views) < LEAST_VIEWS:
        hints.append(f"{LEAST_VIEWS - len(views)} more views, the board tilted differently in each")
    return hints


def is_new(view: View, others: Sequence[View], width: int) -> bool:
    """Whether a live view adds to what is there: some corner of its outline has moved by 6 % of the picture."""
    outline = _outline(view)
    return all(np.abs(outline - _outline(other)).max() > _NEW_VIEW * width for other in others)


def _outline(view: View) -> Array:
    """Picture coordinates (4, 2) of the board's extreme corners."""
    x, y = view.model[:, 0], view.model[:, 1]
    corners = [np.argmin(x + y), np.argmax(x - y), np.argmax(x + y), np.argmin(x - y)]
    return np.asarray(view.image[corners])


def _tilt_spread(rotvecs: Sequence[Array]) -> float:
    """Largest angle between two of the board's normals as the camera saw them, rad."""
    normals = np.array([cv2.Rodrigues(rotvec)[0][:, 2] for rotvec in rotvecs])
    return float(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0)).max())
