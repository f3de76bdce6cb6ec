"""The depth picture's word on how far a tag is, and how it joins with what the tag's size says."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foottrack_service.camera.detector import Detection
from foottrack_service.camera.frame import DepthMap, Frame
from foottrack_service.camera.pose import TargetPose
from foottrack_service.camera.targets import Target
from foottrack_service.compiled import compiled
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
    share, middle = _median_inside(frame.depth, corners)
    pixels = _INNER**2 * _area(corners) * share
    if pixels < _MIN_PIXELS or share < _MIN_SHARE:
        return None
    z = middle * frame.depth_unit
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
        p, cov = _with_depth(p, cov, found.z - by_size + float(pose.p[2] - p[2]), found.sigma)
    return p, cov, statistics.median(ratios) if ratios else None


@compiled
def _with_depth(p: Array, cov: Array, innovation: float, sigma: float) -> tuple[Array, Array]:
    """A place and its covariance, updated by the depth along z."""
    grown = 1.0
    variance = cov[2, 2] + sigma * sigma
    if innovation * innovation > _SURPRISE * variance:
        # Blur makes tags look larger than their corners' noise admits.
        grown = innovation * innovation / (_SURPRISE * variance)
        variance = grown * cov[2, 2] + sigma * sigma
    p_next, cov_next = np.empty(3), np.empty((3, 3))
    for i in range(3):
        p_next[i] = p[i] + grown * cov[2, i] * innovation / variance
        for j in range(3):
            cov_next[i, j] = grown * (cov[i, j] - grown * cov[2, i] * cov[2, j] / variance)
    return p_next, cov_next


def _area(corners: Array) -> float:
    """Of a quadrilateral (4, 2): half the product of its crossed diagonals."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = corners.tolist()
    return float(0.5 * abs((cx - ax) * (dy - by) - (cy - ay) * (dx - bx)))


@compiled
def _median_inside(depth: DepthMap, corners: Array) -> tuple[float, float]:
    """The share of a tag's inner part that has a depth (outside of the picture is none), and the median of it."""
    height, width = depth.shape
    found = np.empty(_SPOTS * _SPOTS, np.uint16)
    valid = 0
    for i in range(_SPOTS):
        v = 0.5 + _INNER * (i / (_SPOTS - 1) - 0.5)
        for j in range(_SPOTS):
            u = 0.5 + _INNER * (j / (_SPOTS - 1) - 0.5)
            a, b, c, d = (1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v
            x = a * corners[0, 0] + b * corners[1, 0] + c * corners[2, 0] + d * corners[3, 0]
            y = a * corners[0, 1] + b * corners[1, 1] + c * corners[2, 1] + d * corners[3, 1]
            if not (-0.5 < x < width - 0.5 and -0.5 < y < height - 0.5):
                continue
            z = depth[int(y + 0.5), int(x + 0.5)]
            if z > 0:
                found[valid] = z
                valid += 1
    if valid == 0:
        return 0.0, 0.0
    known = np.sort(found[:valid])
    half = valid // 2
    middle = float(known[half]) if valid % 2 else 0.5 * (float(known[half - 1]) + float(known[half]))
    return valid / (_SPOTS * _SPOTS), middle
