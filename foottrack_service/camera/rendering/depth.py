"""The depth picture of a stereo camera: noise that grows with the square of the range, holes, shadows, ragged edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from foottrack_service.camera.rendering.noise import NoiseBank
from foottrack_service.camera.rig import Intrinsics
from foottrack_service.rotations import Array

Field = npt.NDArray[np.float32]
Faces = Sequence[tuple[int, ...]]


@dataclass(frozen=True)
class DepthModel:
    """A D435-like stereo matcher.

    Standard deviation of the range: `noise` * z^2 (0.0038 1/m is 0.08 px of disparity at 424 px focal length and
    50 mm `baseline`); `scale` multiplies every range (1 when perfectly calibrated); `holes` is the share of pixels
    without depth in open surfaces; ranges outside `nearest` to `farthest` m are unknown.
    """

    noise: float = 0.0038
    baseline: float = 0.05
    scale: float = 1.0
    holes: float = 0.01
    nearest: float = 0.25
    farthest: float = 6.0

    def spoil(self, inverse: Field, intrinsics: Intrinsics, bank: NoiseBank) -> npt.NDArray[np.uint16]:
        """Depth (h, w) in mm, 0 unknown, as measured, from the true inverse depth (h, w), 1/m."""
        z = 1.0 / np.maximum(inverse, 1.0 / 50.0)
        z += self.noise * z * z * bank.coarse()
        box = np.ones((3, 3), dtype=np.uint8)
        low, high = cv2.erode(inverse, box), cv2.dilate(inverse, box)
        edge = (high - low) > 0.02 + 0.03 * inverse
        dice = bank.fine()
        # At an edge the matcher sees neither surface: half of it is holes, the rest lies somewhere between.
        between = 1.0 / np.maximum(0.5 * (low + high), 0.02)
        z = np.where(edge & (dice > 0.0), between, z)
        unknown = edge & (dice < 0.0)
        unknown |= self._shadow(inverse, intrinsics)
        unknown |= bank.patches() > _quantile(self.holes)
        z *= self.scale
        unknown |= (z < self.nearest) | (z > self.farthest)
        z[unknown] = 0.0
        return np.rint(z * 1000.0).astype(np.uint16)

    def _shadow(self, inverse: Field, intrinsics: Intrinsics) -> npt.NDArray[np.bool_]:
        """What the second eye cannot see, left of every nearer thing."""
        disparity = intrinsics.fx * self.baseline * inverse
        shifted = disparity - np.arange(inverse.shape[1], dtype=np.float32)
        reach = 31
        ahead = cv2.dilate(shifted, np.ones((1, reach), dtype=np.uint8), anchor=(0, 0))
        return np.asarray(ahead > shifted + 0.5)


Surface = tuple[Array, Faces, Array, Array]
"""Vertices (n, 3) and outward faces of a convex body, its place (3,) and rotation (3, 3) in the stage."""


def draw_depth(
    surfaces: Sequence[Surface], camera: tuple[Array, Array], floor_height: float, intrinsics: Intrinsics
) -> Field:
    """True inverse depth (h, w), 1/m, 0 at infinity, from a camera at (place, rotation) in the stage."""
    place, R = camera
    size = (intrinsics.height, intrinsics.width)
    to_rays: Array = np.asarray(np.linalg.inv(intrinsics.matrix), dtype=np.float64)
    inverse = np.maximum(_plane((R @ to_rays)[1] / (floor_height - place[1]), 0, 0, size), 0.0)
    for vertices, faces, p, R_body in surfaces:
        cv = (p + vertices @ R_body.T - place) @ R
        if cv[:, 2].min() > 0.05:
            _draw_body(inverse, cv, faces, intrinsics, to_rays)
    return inverse


def _draw_body(inverse: Field, cv: Array, faces: Faces, intrinsics: Intrinsics, to_rays: Array) -> None:
    pixels = intrinsics.project(cv)
    low = np.maximum(np.floor(pixels.min(axis=0)), 0).astype(int)
    high = np.minimum(np.ceil(pixels.max(axis=0)) + 1, inverse.shape[::-1]).astype(int)
    if np.any(high <= low):
        return
    part = inverse[low[1] : high[1], low[0] : high[0]]
    fixed = np.rint((pixels - low) * 16.0).astype(np.int32)
    for face in faces:
        a, b, c = cv[list(face[:3])]
        normal = np.cross(b - a, c - b)
        distance = float(normal @ a)
        if distance >= 0.0:
            continue
        mask = np.zeros(part.shape, dtype=np.uint8)
        cv2.fillConvexPoly(mask, fixed[list(face)], 1, cv2.LINE_8, 4)
        surface = _plane(normal @ to_rays / distance, low[0], low[1], part.shape)
        np.copyto(part, surface, where=(mask > 0) & (surface > part))


def _plane(coefficients: Array, left: int, top: int, size: tuple[int, ...]) -> Field:
    """Inverse depth of a plane, which is linear in the picture."""
    columns = np.arange(left, left + size[1], dtype=np.float32) * np.float32(coefficients[0])
    rows = np.arange(top, top + size[0], dtype=np.float32) * np.float32(coefficients[1])
    return np.asarray(rows[:, None] + (columns + np.float32(coefficients[2]))[None], dtype=np.float32)


def _quantile(share: float) -> float:
    """Where the upper tail of the unit normal has this share (Abramowitz and Stegun 26.2.23, good to 5e-4)."""
    if share <= 0.0:
        return np.inf
    u = np.sqrt(-2.0 * np.log(share))
    top = 2.515517 + u * (0.802853 + u * 0.010328)
    return float(u - top / (1.0 + u * (1.432788 + u * (0.189269 + u * 0.001308))))
