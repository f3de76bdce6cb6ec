"""The depth picture's word on how far a tag is, and how it joins with what the tag's size says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from foottrack_service.camera.detector import Detection
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.pose import TargetPose
from foottrack_service.camera.targets import Target
from foottrack_service.rotations import Array, to_matrix

PLAUSIBLE_RATIO = (0.8, 1.25)
"""Outside of this, depth and size do not speak of the same thing, and depth is left out of the position."""

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
    centre = corners.mean(axis=0)
    inner = centre + _INNER * (corners - centre)
    low = np.maximum(np.floor(inner.min(axis=0)), 0).astype(int)
    high = np.minimum(np.ceil(inner.max(axis=0)) + 1, frame.depth.shape[::-1]).astype(int)
    if np.any(high <= low):
        return None
    part = frame.depth[low[1] : high[1], low[0] : high[0]]
    mask = np.zeros(part.shape, dtype=np.uint8)
    cv2.fillConvexPoly(mask, np.rint((inner - low) * 16.0).astype(np.int32), 1, cv2.LINE_8, 4)
    inside = part[mask > 0]
    valid = inside[inside > 0]
    if len(valid) < max(_MIN_PIXELS, _MIN_SHARE * len(inside)):
        return None
    z = float(np.median(valid)) * frame.depth_unit
    sigma = noise * z * z / np.sqrt(max(1.0, len(valid) / _CORRELATED_PX))
    return Range(z, float(np.hypot(sigma, _SIGMA_FLOOR_M)))


def join_depth(
    pose: TargetPose, target: Target, seen: Sequence[Detection], frame: Frame, noise: float
) -> tuple[Array, Array, float | None]:
    """Position (3,) and covariance (3, 3) of a pose with depth taken in, and depth's range over the size's, or None.

    A linear update of the position with the depth of each tag's centre: as the corners' covariance is longest along
    the ray, the position moves along it, which is [B]'s "depth sets the range" with both weighed by their noise.
    """
    R = to_matrix(pose.q)
    p, cov = pose.p, pose.cov
    ratios = []
    for detection in seen:
        found = tag_depth(frame, detection.corners, noise)
        if found is None:
            continue
        by_size = float((pose.p + R @ target.corners[detection.id].mean(axis=0))[2])
        ratio = found.z / by_size
        ratios.append(ratio)
        if not PLAUSIBLE_RATIO[0] <= ratio <= PLAUSIBLE_RATIO[1]:
            continue
        innovation = found.z - by_size + float((pose.p - p)[2])
        surprise = innovation**2 / (cov[2, 2] + found.sigma**2)
        if surprise > _SURPRISE:
            # Blur makes tags look larger than their corners' noise admits.
            cov = cov * (surprise / _SURPRISE)
        gain = cov[:, 2] / (cov[2, 2] + found.sigma**2)
        p = p + gain * innovation
        # Joseph's form stays symmetric and positive.
        keep = np.eye(3) - np.outer(gain, (0.0, 0.0, 1.0))
        cov = keep @ cov @ keep.T + found.sigma**2 * np.outer(gain, gain)
    return p, cov, float(np.median(ratios)) if ratios else None
