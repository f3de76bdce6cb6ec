"""Pose of a target from the corners of its tags: both planar solutions, and an honest covariance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from foottrack_service import rotations
from foottrack_service.camera.detector import Detection
from foottrack_service.camera.rig import Intrinsics
from foottrack_service.camera.targets import Tag, Target
from foottrack_service.rotations import Array

CORNER_SIGMA_PX = 0.25
"""Noise of a refined corner of a sharp tag, px per axis."""
_CONFIDENCE = 4.0
"""Weight of that figure against what the residuals of one picture say, in degrees of freedom."""
_SAME_RAD = 0.03
_WORSE = 6.0
"""An alternative whose residuals are so many times larger is none."""
_NEAREST_M = 1e-3
_IDENTITY = np.eye(3)
_CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 10, 1e-9)


@dataclass(frozen=True)
class TargetPose:
    """A target in OpenCV's camera frame.

    `p` (3,) m, `q` (4,) target to camera with the smaller residual, `q_alt` the other solution or None, `cov` (3, 3)
    m^2 of `p` from the corners' noise, `reproj_px` rms residual of the corners.
    """

    p: Array
    q: Array
    q_alt: Array | None
    cov: Array
    reproj_px: float


@dataclass(frozen=True)
class _Fit:
    rotvec: Array
    R: Array
    p: Array
    jacobian: Array
    """(2n, 6) of the n rays by rotation vector and place."""
    squares: float
    """Sum of the residuals', px^2."""


def solve_target(
    target: Target, seen: Sequence[Detection], intrinsics: Intrinsics, sigma_px: float = CORNER_SIGMA_PX
) -> TargetPose | None:
    """Pose of a target from at least one of its tags; None when no pose before the camera explains the corners.

    Each tag gives the two solutions of IPPE; each is refined over the corners of *all* tags seen, which leaves one
    where the tags do not lie in one plane. Least squares in undistorted pixels (rays times focal length), whose noise
    is taken to be `sigma_px` until the residuals say more.
    """
    if not seen:
        return None
    model = np.concatenate([target.corners[d.id] for d in seen])
    rays = intrinsics.rays(np.concatenate([d.corners for d in seen]))
    best_first = range(1) if len(seen) == 1 else sorted(range(len(seen)), key=lambda i: -seen[i].side_px)
    fits: list[_Fit] = []
    for i in best_first[:2]:
        tag = next(tag for tag in target.tags if tag.id == seen[i].id)
        for rotvec, place in _ippe(tag.size, rays[4 * i : 4 * i + 4]):
            fit = _refine(*_of_target(tag, rotvec, place), model, rays, intrinsics.focal)
            if fit is not None and not any(_same(fit, other) for other in fits):
                fits.append(fit)
    if not fits:
        return None
    fits.sort(key=lambda fit: fit.squares)
    first = fits[0]
    floor = sigma_px**2 * len(rays)
    second = next((fit for fit in fits[1:] if fit.squares < _WORSE**2 * (first.squares + floor)), None)
    cov = _covariance(first, intrinsics.focal, sigma_px)
    if cov is None:
        return None
    if second is not None:
        # The position lies between the two solutions, and which is right is not known here.
        apart = second.p - first.p
        cov = cov + 0.25 * np.outer(apart, apart)
    return TargetPose(
        first.p,
        rotations.from_rotation_vector(first.rotvec),
        None if second is None else rotations.from_rotation_vector(second.rotvec),
        cov,
        math.sqrt(first.squares / len(rays)),
    )


def _ippe(size: float, rays: Array) -> list[tuple[Array, Array]]:
    half = 0.5 * size
    square = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
    count, rotvecs, places, _ = cv2.solvePnPGeneric(
        square, rays.reshape(4, 1, 2), _IDENTITY, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    found = []
    for i in range(count):
        rotvec, place = _vector(rotvecs[i]), _vector(places[i])
        if math.isfinite(rotvec.sum() + place.sum()) and place[2] > 0.0:
            found.append((rotvec, place))
    return found


def _of_target(tag: Tag, rotvec: Array, place: Array) -> tuple[Array, Array]:
    """A tag's pose as its target's."""
    if tag.p == (0.0, 0.0, 0.0) and tag.q == (0.0, 0.0, 0.0, 1.0):
        return rotvec, place
    R = cv2.Rodrigues(rotvec)[0] @ rotations.to_matrix(rotations.normalised(tag.q)).T
    return _vector(cv2.Rodrigues(R)[0]), _vector(place - R @ np.asarray(tag.p))


def _refine(rotvec: Array, p: Array, model: Array, rays: Array, focal: float) -> _Fit | None:
    refined = cv2.solvePnPRefineLM(
        model, rays, _IDENTITY, None, rotvec.reshape(3, 1).copy(), p.reshape(3, 1).copy(), _CRITERIA
    )
    rotvec, place = _vector(refined[0]), _vector(refined[1])
    if not math.isfinite(rotvec.sum() + place.sum()):
        return None
    R = np.asarray(cv2.Rodrigues(rotvec)[0], dtype=np.float64)
    if (model @ R[2]).min() + place[2] <= _NEAREST_M:
        return None
    projected, jacobian = cv2.projectPoints(model, rotvec, place, _IDENTITY, None)
    residual = (projected.reshape(-1, 2) - rays).ravel()
    return _Fit(rotvec, R, place, np.asarray(jacobian[:, :6]), focal**2 * float(residual @ residual))


def _covariance(fit: _Fit, focal: float, sigma_px: float) -> Array | None:
    """Of the place, (3, 3); None where the corners do not determine it."""
    # A prior on the corners' noise, updated by this picture's own residuals: blur shows in them.
    variance = (_CONFIDENCE * sigma_px**2 + fit.squares) / (_CONFIDENCE + len(fit.jacobian) - 6)
    sound, inverse = cv2.invert(fit.jacobian.T @ fit.jacobian, flags=cv2.DECOMP_CHOLESKY)
    if not sound or not math.isfinite(inverse.sum()):
        return None
    cov = (0.5 * variance / focal**2) * np.asarray(inverse[3:, 3:], dtype=np.float64)
    return cov + cov.T


def _vector(column: Any) -> Array:
    return np.asarray(column, dtype=np.float64).reshape(3)


def _same(a: _Fit, b: _Fit) -> bool:
    # |A - B|^2 of two rotations is 8 sin^2(angle / 2).
    apart = (a.R - b.R).ravel()
    return bool(apart @ apart < 2.0 * _SAME_RAD**2)
