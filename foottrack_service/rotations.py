"""Quaternions and rotations as every room uses them.

Quaternions are ``[x, y, z, w]`` (float64), unit, and turn vectors of the body's frame into its parent's:
``v_parent = rotate(q, v_body)``. All functions broadcast over leading axes, so one quaternion of shape (4,)
and a track of shape (n, 4) go through the same functions; the products that every sample needs take a path of plain
floats for one quaternion, which is ten times as fast. Tested against ``scipy.spatial.transform.Rotation``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

IDENTITY: Array = np.array([0.0, 0.0, 0.0, 1.0])


def normalised(q: npt.ArrayLike) -> Array:
    """Unit quaternion(s), shape (..., 4). Raises ValueError where one is zero or not finite."""
    q = np.asarray(q, dtype=np.float64)
    if q.ndim == 1:
        x, y, z, w = q.tolist()
        length = math.sqrt(x * x + y * y + z * z + w * w)
        if not 0.0 < length < math.inf:
            raise ValueError("a quaternion is zero or not finite")
        return np.array((x / length, y / length, z / length, w / length))
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    if not np.all(np.isfinite(norm)) or np.any(norm == 0.0):
        raise ValueError("a quaternion is zero or not finite")
    unit: Array = q / norm
    return unit


def multiply(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Hamilton product a b, shapes (..., 4): first b turns, then a."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if a.ndim == 1 and b.ndim == 1:
        return np.array(_product(*a.tolist(), *b.tolist()))
    ax, ay, az, aw = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bx, by, bz, bw = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    return np.stack(_product(ax, ay, az, aw, bx, by, bz, bw), axis=-1)


def conjugate(q: npt.ArrayLike) -> Array:
    """The inverse of unit quaternion(s), shape (..., 4)."""
    inverse: Array = np.asarray(q, dtype=np.float64) * np.array([-1.0, -1.0, -1.0, 1.0])
    return inverse


def rotate(q: npt.ArrayLike, v: npt.ArrayLike) -> Array:
    """Vector(s) v, shape (..., 3), turned by q, shape (..., 4)."""
    q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
    if q.ndim == 1 and v.ndim == 1:
        return np.array(_turned(*q.tolist(), *v.tolist()))
    qx, qy, qz, qw = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return np.stack(_turned(qx, qy, qz, qw, v[..., 0], v[..., 1], v[..., 2]), axis=-1)


def unrotate(q: npt.ArrayLike, v: npt.ArrayLike) -> Array:
    """Vector(s) of the parent's frame, shape (..., 3), seen in the body's."""
    return rotate(conjugate(q), v)


def from_rotation_vector(rotvec: npt.ArrayLike) -> Array:
    """Exponential map: axis times angle in rad, shape (..., 3), to quaternion(s), shape (..., 4)."""
    r = np.asarray(rotvec, dtype=np.float64)
    if r.ndim == 1:
        return _exponential(*r.tolist())
    angle = np.linalg.norm(r, axis=-1, keepdims=True)
    half = 0.5 * angle
    # np.sinc is sin(pi x) / (pi x): exact and smooth through zero.
    xyz = 0.5 * np.sinc(half / np.pi) * r
    return np.concatenate([xyz, np.cos(half)], axis=-1)


def to_rotation_vector(q: npt.ArrayLike) -> Array:
    """Logarithm: quaternion(s), shape (..., 4), to axis times angle in rad in [0, pi], shape (..., 3)."""
    q = np.asarray(q, dtype=np.float64)
    if q.ndim == 1:
        return _logarithm(*q.tolist())
    q = np.where(q[..., 3:] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    safe = np.where(sine < 1e-12, 1.0, sine)
    return q[..., :3] * np.where(sine < 1e-12, 2.0, angle / safe)


def from_axis_angle(axis: npt.ArrayLike, angle: npt.ArrayLike) -> Array:
    """Turn by angle (rad, shape (...)) about a unit axis, shape (3,) or (..., 3)."""
    return from_rotation_vector(np.asarray(axis, dtype=np.float64) * np.asarray(angle)[..., None])


def from_yaw(yaw: npt.ArrayLike) -> Array:
    """Turn about +Y by yaw (rad, positive to the left, seen from above), shape (...) to (..., 4)."""
    return from_axis_angle([0.0, 1.0, 0.0], yaw)


def yaw_of(q: npt.ArrayLike) -> Array:
    """Heading of the body's -Z axis projected on the floor, rad, 0 towards the stage's -Z, shape (...)."""
    forward = rotate(q, [0.0, 0.0, -1.0])
    return np.asarray(np.arctan2(-forward[..., 0], -forward[..., 2]))


def twist_about_up(q: npt.ArrayLike) -> Array:
    """The part of q that turns about +Y (swing-twist), shape (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    twist = np.zeros_like(q)
    twist[..., 1], twist[..., 3] = q[..., 1], q[..., 3]
    norm = np.linalg.norm(twist, axis=-1, keepdims=True)
    return np.where(norm < 1e-9, IDENTITY, twist / np.where(norm < 1e-9, 1.0, norm))


def to_matrix(q: npt.ArrayLike) -> Array:
    """Rotation matrices, shape (..., 3, 3), of unit quaternion(s), shape (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    return np.stack([rotate(q, axis) for axis in np.eye(3)], axis=-1)


def from_matrix(matrix: npt.ArrayLike) -> Array:
    """Quaternion(s), shape (..., 4), of rotation matrices, shape (..., 3, 3) (Shepperd's choice of pivot)."""
    m = np.asarray(matrix, dtype=np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    trace = xx + yy + zz
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    candidates = np.stack(
        [
            np.stack([1 + 2 * xx - trace, xy, xz, wx], axis=-1),
            np.stack([xy, 1 + 2 * yy - trace, yz, wy], axis=-1),
            np.stack([xz, yz, 1 + 2 * zz - trace, wz], axis=-1),
            np.stack([wx, wy, wz, 1 + trace], axis=-1),
        ],
        axis=-2,
    )
    pivot = np.argmax(np.stack([xx, yy, zz, trace], axis=-1), axis=-1)
    chosen = np.take_along_axis(candidates, pivot[..., None, None], axis=-2)[..., 0, :]
    return normalised(chosen)


def slerp(a: npt.ArrayLike, b: npt.ArrayLike, share: npt.ArrayLike) -> Array:
    """From a (share 0) to b (share 1) the short way, shapes (..., 4) and (...)."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    step = to_rotation_vector(multiply(conjugate(a), b))
    return multiply(a, from_rotation_vector(step * np.asarray(share, dtype=np.float64)[..., None]))


def angle_between(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Angle of the turn from a to b, rad in [0, pi], shape (...)."""
    return np.asarray(np.linalg.norm(to_rotation_vector(multiply(conjugate(a), b)), axis=-1))


def continuous(q: npt.ArrayLike) -> Array:
    """The same track of rotations, shape (n, 4), with signs chosen so that neighbours never jump."""
    q = np.array(q, dtype=np.float64)
    dots = np.sum(q[1:] * q[:-1], axis=-1)
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    q[1:] *= signs[:, None]
    return q


def _exponential(x: float, y: float, z: float) -> Array:
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 if angle < 1e-8 else math.sin(0.5 * angle) / angle
    return np.array((x * scale, y * scale, z * scale, math.cos(0.5 * angle)))


def _logarithm(x: float, y: float, z: float, w: float) -> Array:
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-12 else 2.0 * math.atan2(sine, w) / sine
    return np.array((x * scale, y * scale, z * scale))


def _product(ax: Any, ay: Any, az: Any, aw: Any, bx: Any, by: Any, bz: Any, bw: Any) -> tuple[Any, ...]:
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _turned(qx: Any, qy: Any, qz: Any, qw: Any, vx: Any, vy: Any, vz: Any) -> tuple[Any, ...]:
    tx, ty, tz = 2.0 * (qy * vz - qz * vy), 2.0 * (qz * vx - qx * vz), 2.0 * (qx * vy - qy * vx)
    return (
        vx + qw * tx + qy * tz - qz * ty,
        vy + qw * ty + qz * tx - qx * tz,
        vz + qw * tz + qx * ty - qy * tx,
    )
