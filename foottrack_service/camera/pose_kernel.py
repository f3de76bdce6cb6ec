"""The least squares of a target's pose, compiled: a tracked picture has some hundred us for all of its numbers."""

from __future__ import annotations

import math

import numpy as np

from foottrack_service.compiled import compiled
from foottrack_service.rotations import Array

_NEAREST_M = 1e-3
"""A corner that is nearer to the camera's plane is not seen."""
_STEPS = 4
_SMALL_STEP = 1e-9
"""rad and m together: what moves less is there."""
_TRUST = 1e-3
"""Levenberg's share of the diagonal, at first."""
_LEAST_PIVOT = 1e-300


@compiled
def fit_both(
    size: float,
    tag_R: Array,
    tag_p: Array,
    seen: Array,
    model: Array,
    rays: Array,
    R: Array,
    q: Array,
    p: Array,
    cov: Array,
) -> tuple[float, float]:
    """The two poses of IPPE that one tag leaves open, each refined over all corners; sums of their squared residuals.

    The tag, of ``size`` m, stands at ``tag_p`` (3,) m, ``tag_R`` (3, 3) in its target's frame, and is ``seen`` along
    the rays (4, 2). ``model`` (n, 3) m and ``rays`` (n, 2) are of all corners. Written: ``R`` (2, 3, 3), the same as
    ``q`` (2, 4), and ``p`` (2, 3) of the target, ``cov`` (2, 3, 3) of the place for rays whose noise is 1 per axis.
    -1.0 instead of a sum: no such pose is before the camera, finite, and determined by the corners.
    """
    if not _ippe(size, seen, R, p):
        return -1.0, -1.0
    start = np.zeros((3, 3))
    for k in range(2):
        for i in range(3):
            for j in range(3):
                start[i, j] = R[k, i, j]
        for i in range(3):
            for j in range(3):
                R[k, i, j] = start[i, 0] * tag_R[j, 0] + start[i, 1] * tag_R[j, 1] + start[i, 2] * tag_R[j, 2]
        for i in range(3):
            p[k, i] -= R[k, i, 0] * tag_p[0] + R[k, i, 1] * tag_p[1] + R[k, i, 2] * tag_p[2]
    squares = _refine(model, rays, R[0], p[0], cov[0]), _refine(model, rays, R[1], p[1], cov[1])
    for k in range(2):
        _quaternion(R[k], q[k])
    return squares


@compiled
def spread(cov: Array, variance: float, p: Array, other: Array) -> Array:
    """Covariance (3, 3) of a place ``p`` (3,) that may as well be half way to another: ``cov`` is for noise of 1."""
    wide = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            wide[i, j] = variance * cov[i, j] + 0.25 * (other[i] - p[i]) * (other[j] - p[j])
    return wide


@compiled
def _ippe(size: float, seen: Array, R: Array, p: Array) -> bool:
    """Both poses of a square from its homography's derivative at the centre (Collins and Bartoli, IPPE, 2014)."""
    x0, y0, x1, y1 = seen[0, 0], seen[0, 1], seen[1, 0], seen[1, 1]
    x2, y2, x3, y3 = seen[2, 0], seen[2, 1], seen[3, 0], seen[3, 1]
    # Square to quadrilateral, (a s + b t + x0) / (g s + h t + 1) with s, t from 0 to 1 (Heckbert, 1989).
    ax, ay, bx, by = x1 - x2, y1 - y2, x3 - x2, y3 - y2
    sx, sy = x0 - x1 + x2 - x3, y0 - y1 + y2 - y3
    det = ax * by - bx * ay
    g, h = (sx * by - bx * sy) / det, (ax * sy - sx * ay) / det
    a, b = x1 - x0 + g * x1, x3 - x0 + h * x3
    d, e = y1 - y0 + g * y1, y3 - y0 + h * y3
    w = 0.5 * (g + h) + 1.0
    u, v = (0.5 * (a + b) + x0) / w, (0.5 * (d + e) + y0) / w
    per_m = 1.0 / (w * size)
    j00, j01, j10, j11 = (a - g * u) * per_m, (h * u - b) * per_m, (d - g * v) * per_m, (h * v - e) * per_m
    # V turns the optical axis to the centre's ray; in its frame the derivative is a rotation's upper left over range.
    n = math.sqrt(1.0 + u * u + v * v)
    k = 1.0 / (n * (n + 1.0))
    b00, b01, b11 = 1.0 + u * u * (1.0 / n - k), u * v * (1.0 / n - k), 1.0 + v * v * (1.0 / n - k)
    det = b00 * b11 - b01 * b01
    a00, a01 = (b11 * j00 - b01 * j10) / det, (b11 * j01 - b01 * j11) / det
    a10, a11 = (b00 * j10 - b01 * j00) / det, (b00 * j11 - b01 * j01) / det
    top, low, both = a00 * a00 + a01 * a01, a10 * a10 + a11 * a11, a00 * a10 + a01 * a11
    near = math.sqrt(0.5 * (top + low + math.sqrt((top - low) * (top - low) + 4.0 * both * both)))
    if not 0.0 < near < np.inf:
        return False
    a00, a01, a10, a11 = a00 / near, a01 / near, a10 / near, a11 / near
    c0 = math.sqrt(max(0.0, 1.0 - a00 * a00 - a10 * a10))
    c1 = math.sqrt(max(0.0, 1.0 - a01 * a01 - a11 * a11))
    if a00 * a01 + a10 * a11 > 0.0:
        c1 = -c1
    for i in range(2):
        T = (
            (a00, a01, a10 * c1 - c0 * a11),
            (a10, a11, c0 * a01 - a00 * c1),
            (c0, c1, a00 * a11 - a01 * a10),
        )
        for j in range(3):
            R[i, 0, j] = (1.0 - u * u * k) * T[0][j] - u * v * k * T[1][j] + u / n * T[2][j]
            R[i, 1, j] = (1.0 - v * v * k) * T[1][j] - u * v * k * T[0][j] + v / n * T[2][j]
            R[i, 2, j] = (T[2][j] - u * T[0][j] - v * T[1][j]) / n
        p[i, 0], p[i, 1], p[i, 2] = u / near, v / near, 1.0 / near
        c0, c1 = -c0, -c1
    return True


@compiled
def _refine(model: Array, rays: Array, R: Array, p: Array, cov: Array) -> float:
    """A pose over corners, by Levenberg and Marquardt: the sum of the squared residuals, -1.0 for none."""
    A, b = np.zeros((6, 6)), np.zeros(6)
    squares = _normal_equations(model, rays, R, p, A, b)
    if not squares >= 0.0:
        return -1.0
    R_next, p_next, A_next, b_next = np.zeros((3, 3)), np.zeros(3), np.zeros((6, 6)), np.zeros(6)
    L, x = np.zeros((6, 6)), np.zeros(6)
    trust = _TRUST
    for _ in range(_STEPS):
        if not _factor(A, trust, L):
            return -1.0
        _solve(L, b, x)
        _turn(R, x[0], x[1], x[2], R_next)
        size = 0.0
        for i in range(3):
            p_next[i] = p[i] + x[3 + i]
            size += x[i] * x[i] + x[3 + i] * x[3 + i]
        squares_next = _normal_equations(model, rays, R_next, p_next, A_next, b_next)
        if 0.0 <= squares_next <= squares:
            squares = squares_next
            for i in range(3):
                p[i] = p_next[i]
                for j in range(3):
                    R[i, j] = R_next[i, j]
            A, A_next, b, b_next = A_next, A, b_next, b
            trust = 0.1 * trust
        else:
            trust = 10.0 * trust
        if size < _SMALL_STEP * _SMALL_STEP:
            break
    if not _factor(A, 0.0, L):
        return -1.0
    for j in range(3):
        for i in range(6):
            b[i] = 0.0
        b[3 + j] = 1.0
        _solve(L, b, x)
        for i in range(3):
            cov[i, j] = x[3 + i]
    return squares


@compiled
def _normal_equations(model: Array, rays: Array, R: Array, p: Array, A: Array, b: Array) -> float:
    """J' J and J' (seen - projected) of a turn about the camera's axes, then a shift; the residuals' squares."""
    for i in range(6):
        b[i] = 0.0
        for j in range(6):
            A[i, j] = 0.0
    squares = 0.0
    J = np.zeros((2, 6))
    for n in range(len(model)):
        x = R[0, 0] * model[n, 0] + R[0, 1] * model[n, 1] + R[0, 2] * model[n, 2]
        y = R[1, 0] * model[n, 0] + R[1, 1] * model[n, 1] + R[1, 2] * model[n, 2]
        z = R[2, 0] * model[n, 0] + R[2, 1] * model[n, 1] + R[2, 2] * model[n, 2]
        depth = z + p[2]
        if not depth > _NEAREST_M:
            return -1.0
        near = 1.0 / depth
        u, v = (x + p[0]) * near, (y + p[1]) * near
        J[0, 0], J[0, 1], J[0, 2] = -u * y * near, (z + u * x) * near, -y * near
        J[1, 0], J[1, 1], J[1, 2] = (-z - v * y) * near, v * x * near, x * near
        J[0, 3], J[0, 5] = near, -u * near
        J[1, 4], J[1, 5] = near, -v * near
        du, dv = rays[n, 0] - u, rays[n, 1] - v
        squares += du * du + dv * dv
        for i in range(6):
            b[i] += J[0, i] * du + J[1, i] * dv
            for j in range(i + 1):
                A[i, j] += J[0, i] * J[0, j] + J[1, i] * J[1, j]
    return squares


@compiled
def _factor(A: Array, trust: float, L: Array) -> bool:
    """Cholesky's L of A, whose diagonal is enlarged by a share of itself."""
    for i in range(6):
        for j in range(i + 1):
            left = A[i, j] * (1.0 + trust) if i == j else A[i, j]
            for k in range(j):
                left -= L[i, k] * L[j, k]
            if i != j:
                L[i, j] = left / L[j, j]
            elif left > _LEAST_PIVOT + 1e-13 * A[i, i]:
                L[i, i] = math.sqrt(left)
            else:
                return False
    return True


@compiled
def _solve(L: Array, b: Array, x: Array) -> None:
    for i in range(6):
        left = b[i]
        for k in range(i):
            left -= L[i, k] * x[k]
        x[i] = left / L[i, i]
    for i in range(5, -1, -1):
        left = x[i]
        for k in range(i + 1, 6):
            left -= L[k, i] * x[k]
        x[i] = left / L[i, i]


@compiled
def _turn(R: Array, x: float, y: float, z: float, turned: Array) -> None:
    """exp([x, y, z]) R, by Rodrigues' formula."""
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-4:
        sine, cosine = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        sine, cosine = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    for j in range(3):
        a, b, c = R[0, j], R[1, j], R[2, j]
        along = cosine * (x * a + y * b + z * c)
        keep = 1.0 - cosine * square
        turned[0, j] = keep * a + along * x + sine * (y * c - z * b)
        turned[1, j] = keep * b + along * y + sine * (z * a - x * c)
        turned[2, j] = keep * c + along * z + sine * (x * b - y * a)


@compiled
def _quaternion(R: Array, q: Array) -> None:
    """[x, y, z, w] of a rotation matrix (Shepperd's choice of pivot)."""
    pivot, largest = 3, R[0, 0] + R[1, 1] + R[2, 2]
    trace = largest
    for i in range(3):
        if R[i, i] > largest:
            pivot, largest = i, R[i, i]
    if pivot == 3:
        q[0], q[1], q[2], q[3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + trace
    else:
        i, j, k = pivot, (pivot + 1) % 3, (pivot + 2) % 3
        q[i], q[j], q[k] = 1.0 + 2.0 * R[i, i] - trace, R[i, j] + R[j, i], R[i, k] + R[k, i]
        q[3] = R[k, j] - R[j, k]
    norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] = q[i] / norm
