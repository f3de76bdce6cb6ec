"""The camera's geometry: its lens, and where it sits on the head.

Two conventions meet here and nowhere else. OpenCV's camera looks along +Z with +Y down; the wire's camera (as in
OpenXR and Godot) looks along -Z with +Y up. They differ by half a turn about X, which `Rig.to_head` applies
together with the mount. Everything else in this room works in OpenCV's camera frame, called ``*_cv``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from foottrack_service import rotations
from foottrack_service.camera.settings import DISTORTION_LENGTHS
from foottrack_service.compiled import compiled
from foottrack_service.rotations import Array

CV_TO_CAMERA: Array = np.array([1.0, 0.0, 0.0, 0.0])
"""Quaternion from OpenCV's camera axes to the wire's: half a turn about X (its own inverse)."""

DEFAULT_MOUNT_P = (0.0, 0.0, -0.08)
DEFAULT_MOUNT_Q = (-0.17364818, 0.0, 0.0, 0.98480775)


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole with OpenCV's distortion model.

    `width`, `height`, `fx`, `fy`, `cx`, `cy` in px, pixel centres at integers; `distortion` is (), or OpenCV's
    4, 5, 8, 12 or 14 coefficients. Raises ValueError when a value cannot be a camera's.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    matrix: Array = field(init=False, repr=False, compare=False)
    coefficients: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        numbers = [self.fx, self.fy, self.cx, self.cy, *self.distortion]
        if not np.all(np.isfinite(numbers)) or min(self.fx, self.fy) <= 0.0:
            raise ValueError("focal lengths must be positive and all intrinsics finite")
        if self.width <= 0 or self.height <= 0:
            raise ValueError(f"a picture of {self.width} x {self.height} px is none")
        if len(self.distortion) not in DISTORTION_LENGTHS:
            raise ValueError(f"OpenCV knows 0, 4, 5, 8, 12 or 14 distortion coefficients, not {len(self.distortion)}")
        matrix = np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "coefficients", np.array(self.distortion or (0.0,) * 5))

    @property
    def focal(self) -> float:
        """Mean focal length, px."""
        return 0.5 * (self.fx + self.fy)

    def project(self, points_cv: npt.ArrayLike) -> Array:
        """Pixels, shape (n, 2), of points in the camera's OpenCV frame, shape (n, 3), m, all with z > 0."""
        points = np.asarray(points_cv, dtype=np.float64).reshape(-1, 1, 3)
        pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), self.matrix, self.coefficients)
        return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)

    def project_one(self, x: float, y: float, z: float) -> tuple[float, float]:
        """`project` of one point, in a tenth of the time where the lens does not distort."""
        if not self.distortion:
            return self.fx * x / z + self.cx, self.fy * y / z + self.cy
        u, v = self.project((x, y, z))[0].tolist()
        return u, v

    def rays(self, pixels: npt.ArrayLike) -> Array:
        """Undistorted image coordinates x/z, y/z, shape (n, 2), of pixels, shape (n, 2)."""
        flat = np.ascontiguousarray(pixels, dtype=np.float64).reshape(-1, 2)
        if not self.distortion:
            return _straight_rays(flat, self.fx, self.fy, self.cx, self.cy)
        undistorted = cv2.undistortPoints(flat.reshape(-1, 1, 2), self.matrix, self.coefficients)
        return np.asarray(undistorted, dtype=np.float64).reshape(-1, 2)

    def scaled(self, factor: float) -> Intrinsics:
        """The same lens on a picture resized by `factor` (pixel centres at integers)."""
        return Intrinsics(
            round(self.width * factor),
            round(self.height * factor),
            self.fx * factor,
            self.fy * factor,
            (self.cx + 0.5) * factor - 0.5,
            (self.cy + 0.5) * factor - 0.5,
            self.distortion,
        )


D435_COLOUR = Intrinsics(848, 480, 612.0, 612.0, 423.5, 239.5)
"""What a D435's colour camera has at 848x480 before anybody calibrated it."""


@dataclass(frozen=True)
class Rig:
    """A lens and its mount: `mount_p` (3,) m and `mount_q` (4,) take the wire's camera frame to the head frame."""

    intrinsics: Intrinsics
    mount_p: tuple[float, float, float] = DEFAULT_MOUNT_P
    mount_q: tuple[float, float, float, float] = DEFAULT_MOUNT_Q
    q_cv: Array = field(init=False, repr=False, compare=False)
    """(4,) OpenCV's camera frame to the head frame."""
    R_cv: Array = field(init=False, repr=False, compare=False)
    """(3, 3) the same as a matrix."""
    p_cv: Array = field(init=False, repr=False, compare=False)
    """(3,) m of the camera in the head frame."""

    def __post_init__(self) -> None:
        if not np.all(np.isfinite(self.mount_p)):
            raise ValueError("the mount's position is not finite")
        q_cv = rotations.multiply(rotations.normalised(self.mount_q), CV_TO_CAMERA)
        object.__setattr__(self, "q_cv", q_cv)
        object.__setattr__(self, "R_cv", rotations.to_matrix(q_cv))
        object.__setattr__(self, "p_cv", np.array(self.mount_p))

    def to_head(self, p_cv: npt.ArrayLike) -> Array:
        """Points, shape (..., 3), m, from OpenCV's camera frame to the head frame."""
        points = np.ascontiguousarray(p_cv, dtype=np.float64)
        return _moved(self.R_cv, self.p_cv, points.reshape(-1, 3)).reshape(points.shape)

    def from_head(self, p_head: npt.ArrayLike) -> Array:
        """Points, shape (..., 3), m, from the head frame to OpenCV's camera frame."""
        return np.asarray((np.asarray(p_head, dtype=np.float64) - self.p_cv) @ self.R_cv)

    def rotation_to_head(self, q: npt.ArrayLike) -> Array:
        """Rotation(s) body to OpenCV's camera, shape (..., 4), as body to head."""
        return rotations.multiply(self.q_cv, q)

    def covariance_to_head(self, cov: Array) -> Array:
        """Covariance of a position, shape (3, 3), m^2, turned from OpenCV's camera frame to the head's."""
        return _turned(self.R_cv, cov)


@compiled
def _straight_rays(pixels: Array, fx: float, fy: float, cx: float, cy: float) -> Array:
    rays = np.empty((len(pixels), 2))
    for i in range(len(pixels)):
        rays[i, 0], rays[i, 1] = (pixels[i, 0] - cx) / fx, (pixels[i, 1] - cy) / fy
    return rays


@compiled
def _moved(R: Array, p: Array, points: Array) -> Array:
    moved = np.empty_like(points)
    for n in range(len(points)):
        for i in range(3):
            moved[n, i] = R[i, 0] * points[n, 0] + R[i, 1] * points[n, 1] + R[i, 2] * points[n, 2] + p[i]
    return moved


@compiled
def _turned(R: Array, cov: Array) -> Array:
    turned = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for n in range(3):
                    turned[i, j] += R[i, k] * cov[k, n] * R[j, n]
    return turned
