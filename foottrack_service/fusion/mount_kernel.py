"""The sums of the mount's least squares, compiled: a picture costs a few us, so that each of them may count."""

from __future__ import annotations

import numpy as np

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import quaternion, rotation, turned, vector
from foottrack_service.fusion.foot_filter_kernel import invert3
from foottrack_service.rotations import Array

SCALE, POINT, VALUE, COLUMNS = 6, 7, 10, 11
"""Columns of a stance's sums: the 7 unknowns, the depth's scale last of them, its own point (3) from POINT on, the
measured value."""


@compiled
def collect(
    sums: Array, values: Array, head_p: Array, head_q: Array, p: Array, cov: Array, noise: float, weight: float
) -> float:
    """Add a target seen at ``p`` (head frame, m, covariance ``cov``) to a stance's sums A' W A, shape (11, 11).

    A = [J | 1 | z] with z = head.p + R p and J = [R [p]x, -R, -R p], see mount_calibration; ``noise``, m^2 per axis,
    comes on top of the covariance. ``weight`` is the picture's; 0.0 adds nothing. Returns the squared Mahalanobis
    distance from what the sums and the 7 ``values`` expect; inf for a covariance that is none.
    """
    R = rotation(quaternion(head_q, 0))
    seen = turned(R, vector(p, 0))
    A = np.zeros((3, COLUMNS))
    full = np.zeros((3, 3))
    for i in range(3):
        a, b, c = R[i]
        A[i, 0], A[i, 1], A[i, 2] = b * p[2] - c * p[1], c * p[0] - a * p[2], a * p[1] - b * p[0]
        A[i, 3], A[i, 4], A[i, 5] = -a, -b, -c
        A[i, SCALE] = -seen[i]
        A[i, POINT + i] = 1.0
        A[i, VALUE] = head_p[i] + seen[i]
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    full[i, j] += R[i][k] * cov[k, m] * R[j][m]
        full[i, i] += noise
    found, W = _inverse3(full)
    if not found:
        return np.inf
    distance = _distance(sums, values, A, W)
    if weight > 0.0:
        for i in range(COLUMNS):
            for k in range(3):
                share = weight * (A[0, i] * W[0][k] + A[1, i] * W[1][k] + A[2, i] * W[2][k])
                for j in range(COLUMNS):
                    sums[i, j] += share * A[k, j]
        # A target's noise is in the column of the scale too, with the other sign: left in, it passes for scale.
        shared = weight * (3.0 - noise * (W[0][0] + W[1][1] + W[2][2]))
        sums[SCALE, VALUE] += shared
        sums[VALUE, SCALE] += shared
    return distance


@compiled
def _inverse3(S: Array) -> tuple[bool, tuple[tuple[float, float, float], ...]]:
    return invert3(((S[0, 0], S[0, 1], S[0, 2]), (S[1, 0], S[1, 1], S[1, 2]), (S[2, 0], S[2, 1], S[2, 2])))


@compiled
def _distance(sums: Array, values: Array, A: Array, W: tuple[tuple[float, float, float], ...]) -> float:
    """Of the newest picture from the stance's own point, as the ``values`` give both."""
    found, inverse = _inverse3(sums[POINT:VALUE, POINT:VALUE])
    if not found:
        return 0.0
    rest, off = np.empty(3), np.empty(3)
    for k in range(3):
        rest[k] = sums[POINT + k, VALUE]
        off[k] = A[k, VALUE]
        for j in range(POINT):
            rest[k] -= sums[POINT + k, j] * values[j]
            off[k] -= A[k, j] * values[j]
    distance = 0.0
    for k in range(3):
        off[k] -= inverse[k][0] * rest[0] + inverse[k][1] * rest[1] + inverse[k][2] * rest[2]
    for k in range(3):
        for m in range(3):
            distance += off[k] * W[k][m] * off[m]
    return distance
