"""The floor as a plane in the depth picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.rig import Intrinsics, Rig
from foottrack_service.rotations import Array

_SAMPLES = (24, 32)
_TRIALS = 64
_INLIER_M = 0.02
_MIN_SHARE = 0.3
_HEIGHT_M = (0.3, 2.5)
"""How far a camera on a head may be above the floor."""


@dataclass(frozen=True)
class Plane:
    """`normal` (3,) unit, towards the camera, and `height` m of the camera above: normal . x + height = 0.

    OpenCV's camera frame. `share` of the depth samples within 2 cm, whose rms distance is `rms` m.
    """

    normal: Array
    height: float
    share: float
    rms: float

    def above(self, points_cv: npt.ArrayLike) -> Array:
        """Height of points, shape (..., 3), above the plane, m."""
        return np.asarray(np.asarray(points_cv, dtype=np.float64) @ self.normal + self.height)


class FloorError(ValueError):
    """A floor that cannot be measured; the text says why."""


def find_floor(frame: Frame, intrinsics: Intrinsics, previous: Plane | None = None) -> Plane | None:
    """The largest plane below the camera, or None. `previous` saves the search while it still fits.

    Random samples of three points (RANSAC) on a grid over the picture, then least squares on what agrees.
    """
    points = _grid_points(frame, intrinsics)
    if len(points) < 30:
        return None
    if previous is not None:
        refined = _refit(points, previous.normal, previous.height, 3.0 * _INLIER_M)
        if refined is not None and refined.share >= max(_MIN_SHARE, 0.8 * previous.share):
            return refined
    # The same picture gives the same floor.
    picks = np.random.default_rng(len(points)).integers(0, len(points), (_TRIALS, 3))
    a, b, c = points[picks[:, 0]], points[picks[:, 1]], points[picks[:, 2]]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    sound = lengths > 1e-6
    normals, a = normals[sound] / lengths[sound, None], a[sound]
    heights = -np.sum(normals * a, axis=1)
    normals, heights = normals * np.sign(heights)[:, None], np.abs(heights)
    # The floor's normal points up, and up is never down in the picture of a head-worn camera.
    below = (heights > _HEIGHT_M[0]) & (heights < _HEIGHT_M[1]) & (normals[:, 1] < 0.3)
    if not below.any():
        return None
    normals, heights = normals[below], heights[below]
    votes = np.sum(np.abs(points @ normals.T + heights) < 2.0 * _INLIER_M, axis=0)
    best = int(np.argmax(votes))
    return _refit(points, normals[best], float(heights[best]), 2.0 * _INLIER_M)


@dataclass(frozen=True)
class FloorCalibration:
    """`height` m of the floor in the stage below the head; `tilt` rad of the plane against the stage's up.

    `spread` m is the standard deviation of the single pictures' heights, `pictures` how many were used.
    """

    height: float
    tilt: float
    spread: float
    pictures: int


def calibrate_floor(
    planes: list[Plane], heads: list[tuple[Array, Array]], rig: Rig, max_tilt: float = np.radians(3.0)
) -> FloorCalibration:
    """The stage's floor height from planes and the head poses (p (3,), q (4,), head to stage) of the same pictures.

    Raises FloorError: fewer than 10 pictures, heights that scatter by more than 1 cm, or a mean tilt above `max_tilt`
    rad, which a floor does not have but a wrong camera mount does.
    """
    if len(planes) < 10 or len(planes) != len(heads):
        raise FloorError(f"{min(len(planes), len(heads))} pictures show floor and head pose; look at a free floor")
    heights, ups = [], []
    for plane, (p, q) in zip(planes, heads, strict=True):
        up = rotations.rotate(q, rig.R_cv @ plane.normal)
        camera = np.asarray(p) + rotations.rotate(q, rig.mount_p)
        # Straight below the camera, so that a tilt costs nothing where the feet are.
        heights.append(float(camera[1] - plane.height / max(up[1], 0.5)))
        ups.append(up)
    mean_up = np.mean(ups, axis=0)
    tilt = float(np.arccos(np.clip(mean_up[1] / np.linalg.norm(mean_up), -1.0, 1.0)))
    spread = float(np.std(heights))
    if tilt > max_tilt:
        raise FloorError(f"the floor seems to tilt by {np.degrees(tilt):.1f} deg: check [camera] mount")
    if spread > 0.01:
        raise FloorError(f"heights scatter by {1000.0 * spread:.0f} mm: hold the head still and look at a free floor")
    return FloorCalibration(float(np.median(heights)), tilt, spread, len(planes))


def _grid_points(frame: Frame, intrinsics: Intrinsics) -> Array:
    if frame.depth is None:
        return np.zeros((0, 3))
    rows, columns, rays = _grid(frame.depth.shape, intrinsics)
    z = frame.depth[rows, columns].astype(np.float64) * frame.depth_unit
    known = (z > 0.0) & (z < 4.0)
    return rays[known] * z[known, None]


@lru_cache(maxsize=4)
def _grid(shape: tuple[int, int], intrinsics: Intrinsics) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array]:
    """Rows (n,) and columns (n,) of samples all over a picture, and their rays (n, 3) of unit depth."""
    rows = np.linspace(0, shape[0] - 1, _SAMPLES[0] + 2)[1:-1].astype(np.intp)
    columns = np.linspace(0, shape[1] - 1, _SAMPLES[1] + 2)[1:-1].astype(np.intp)
    v, u = (each.ravel() for each in np.meshgrid(rows, columns, indexing="ij"))
    return v, u, np.column_stack([intrinsics.rays(np.stack([u, v], axis=1)), np.ones(len(u))])


def _refit(points: Array, normal: Array, height: float, within: float) -> Plane | None:
    for _ in range(2):
        agree = points[np.abs(points @ normal + height) < within]
        if len(agree) < _MIN_SHARE * len(points):
            return None
        centre = agree.mean(axis=0)
        off = agree - centre
        normal = np.linalg.eigh(off.T @ off)[1][:, 0]
        height = -float(normal @ centre)
        if height < 0.0:
            normal, height = -normal, -height
        within = _INLIER_M
    distance = points @ normal + height
    near = np.abs(distance) < _INLIER_M
    if not near.any() or not _HEIGHT_M[0] < height < _HEIGHT_M[1]:
        return None
    return Plane(normal, height, float(near.mean()), float(np.sqrt(np.mean(distance[near] ** 2))))
