"""The depth picture's word on how far a tag is, and how it joins with what the tag's size says."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foottrack_service.camera.detector import Detection
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.pose import TargetPose
from foottrack_service.camera.targets import Target
from foottrack_service.rotations import Array, rotate

DEPTH_NOISE = 0.0038
"""Standard deviation of a depth pixel at 1 m, m: 0.08 px of disparity of a D435 at 848 px."""
PLAUSIBLE_RATIO = (0.8, 1.25)
"""Outside of this, depth and size do not speak of the same thing, and depth is left out of the position."""

_SPOTS = 14
"""Depth is read at so many by so many spots of a tag: every pixel of a small one, enough of a large one."""
_INNER = 0.7
_MIN_SHARE = 0.3
_MIN_PIXELS = 4
_CORRELATED_PX = 25.0
"""Neighbours of a stereo match share their error: so many pixels count as one."""
_SIGMA_FLOOR_M = 0.001
_SURPRISE = 4.0


@dataclass(frozen=True)
class Range:
    """Depth along the optical axis, m, with its standard deviation."""

    z: float
    sigma: float


def tag_depth(frame: Frame, corners: Array, noise: float) -> Range | None:
    """Median depth of the valid pixels inside a tag's corners (4, 2) px; None where too few are valid.

    `noise` is the standard deviation of one pixel at 1 m; it grows with the square of the range [B].
    """
    if frame.depth is None:
        return None
    spots = np.rint(_WEIGHTS @ corners).astype(np.intp)
    height, width = frame.depth.shape
    columns, rows = spots[:, 0], spots[:, 1]
    if min(columns.min(), rows.min()) < 0 or columns.max() >= width or rows.max() >= height:
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        columns, rows = columns[inside], rows[inside]
    read = frame.depth[rows, columns]
    valid = read[read > 0]
    pixels = _INNER**2 * _area(corners) * len(valid) / len(spots)
    if pixels < _MIN_PIXELS or len(valid) < _MIN_SHARE * len(spots):
        return None
    z = float(np.median(valid)) * frame.depth_unit
    sigma = noise * z * z / math.sqrt(max(1.0, pixels / _CORRELATED_PX))
    return Range(z, math.hypot(sigma, _SIGMA_FLOOR_M))


def join_depth(
    pose: TargetPose, target: Target, seen: Sequence[Detection], frame: Frame, noise: float
) -> tuple[Array, Array, float | None]:
    """Position (3,) and covariance (3, 3) of a pose with depth taken in, and depth's range over the size's, or None.

    A linear update of the position with the depth of each tag's centre: as the corners' covariance is longest along
    the ray, the position moves along it, which is [B]'s "depth sets the range" with both weighed by their noise.
    """
    p, cov = pose.p, pose.cov
    ratios = []
    for detection in seen:
        found = tag_depth(frame, detection.corners, noise)
        if found is None:
            continue
        by_size = float(pose.p[2] + rotate(pose.q, target.centres[detection.id])[2])
        ratio = found.z / by_size
        ratios.append(ratio)
        if not PLAUSIBLE_RATIO[0] <= ratio <= PLAUSIBLE_RATIO[1]:
            continue
        innovation = found.z - by_size + float(pose.p[2] - p[2])
        variance = float(cov[2, 2]) + found.sigma**2
        if innovation**2 > _SURPRISE * variance:
            # Blur makes tags look larger than their corners' noise admits.
            cov = cov * (innovation**2 / (_SURPRISE * variance))
            variance = float(cov[2, 2]) + found.sigma**2
        along = cov[2]
        p = p + along * (innovation / variance)
        cov = cov - np.outer(along, along / variance)
    return p, cov, statistics.median(ratios) if ratios else None


def _area(corners: Array) -> float:
    """Of a quadrilateral (4, 2): half the product of its crossed diagonals."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = corners.tolist()
    return float(0.5 * abs((cx - ax) * (dy - by) - (cy - ay) * (dx - bx)))


def _spots() -> Array:
    """Bilinear weights (n, 4) of a tag's corners, at spots of its inner part."""
    u, v = np.meshgrid(*2 * [0.5 + _INNER * np.linspace(-0.5, 0.5, _SPOTS)])
    return np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1).reshape(-1, 4)


_WEIGHTS = _spots()
