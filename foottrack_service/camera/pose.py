"""Pose of a target from the corners of its tags: both planar solutions, and an honest covariance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foottrack_service.camera import pose_kernel
from foottrack_service.camera.detector import Detection
from foottrack_service.camera.rig import Intrinsics
from foottrack_service.camera.targets import Target
from foottrack_service.rotations import Array

CORNER_SIGMA_PX = 0.25
"""Noise of a refined corner of a sharp tag, px per axis."""
_CONFIDENCE = 4.0
"""Weight of that figure against what the residuals of one picture say, in degrees of freedom."""
_SAME_RAD = 0.03
_WORSE = 6.0
"""An alternative whose residuals are so many times larger is none."""


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
    q: Array
    p: Array
    cov: Array
    """(3, 3) of the place, for rays whose noise is 1."""
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
    if len(seen) == 1:
        model, corners = target.corners[seen[0].id], seen[0].corners
        best_first: Sequence[int] = (0,)
    else:
        model = np.concatenate([target.corners[d.id] for d in seen])
        corners = np.concatenate([d.corners for d in seen])
        best_first = sorted(range(len(seen)), key=lambda i: -seen[i].side_px)
    rays = intrinsics.rays(corners)
    found = [
        fit
        for i in best_first[:2]
        for fit in _fits(target, seen[i].id, rays[4 * i : 4 * i + 4], model, rays, intrinsics.focal)
    ]
    if not found:
        return None
    found.sort(key=lambda fit: fit.squares)
    first = found[0]
    floor = sigma_px**2 * len(rays)
    others = (fit for fit in found[1:] if not _same(fit, first))
    second = next((fit for fit in others if fit.squares < _WORSE**2 * (first.squares + floor)), None)
    # A prior on the corners' noise, updated by this picture's own residuals: blur shows in them.
    variance = (_CONFIDENCE * sigma_px**2 + first.squares) / (_CONFIDENCE + 2 * len(rays) - 6)
    # Where there is a second one, the position lies between the two, and which is right is not known here.
    other = first.p if second is None else second.p
    cov = pose_kernel.spread(first.cov, variance / intrinsics.focal**2, first.p, other)
    return TargetPose(
        first.p,
        first.q,
        None if second is None else second.q,
        cov,
        math.sqrt(first.squares / len(rays)),
    )


def _fits(target: Target, tag_id: int, seen: Array, model: Array, rays: Array, focal: float) -> list[_Fit]:
    R, q, p, cov = np.empty((2, 3, 3)), np.empty((2, 4)), np.empty((2, 3)), np.empty((2, 3, 3))
    tag = target.sizes[tag_id], target.turns[tag_id], target.centres[tag_id]
    both = pose_kernel.fit_both(*tag, seen, model, rays, R, q, p, cov)
    return [_Fit(q[i], p[i], cov[i], focal**2 * both[i]) for i in range(2) if both[i] >= 0.0]


def _same(a: _Fit, b: _Fit) -> bool:
    # |a b| of two quaternions is the cosine of half the angle between them.
    (ax, ay, az, aw), (bx, by, bz, bw) = a.q.tolist(), b.q.tolist()
    cosine = ax * bx + ay * by + az * bz + aw * bw
    return bool(1.0 - cosine * cosine < 0.25 * _SAME_RAD**2)
