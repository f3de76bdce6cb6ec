"""Rotations for compiled code, as ``foottrack_service.rotations`` has them for everybody else.

Quaternions are ``[x, y, z, w]``, body to parent.
"""

from __future__ import annotations

import math

from foottrack_service.compiled import compiled
from foottrack_service.rotations import Array

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]
"""Rows. Compiled code keeps tuples in registers; a small array would be allocated each time."""


@compiled
def squared(a: float) -> float:
    """a a, which Python's ``a ** 2`` is not always to the last bit, and compiled code's is."""
    return a * a


@compiled
def vector(a: Array, i: int) -> Vector:
    """Three numbers from index i on."""
    return a[i], a[i + 1], a[i + 2]


@compiled
def quaternion(a: Array, i: int) -> Quaternion:
    """Four numbers from index i on."""
    return a[i], a[i + 1], a[i + 2], a[i + 3]


@compiled
def rotation(q: Quaternion) -> Matrix:
    """The matrix of q."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@compiled
def turned(R: Matrix, v: Vector) -> Vector:
    """R v."""
    return (
        R[0][0] * v[0] + R[0][1] * v[1] + R[0][2] * v[2],
        R[1][0] * v[0] + R[1][1] * v[1] + R[1][2] * v[2],
        R[2][0] * v[0] + R[2][1] * v[1] + R[2][2] * v[2],
    )


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product of two quaternions: first b turns, then a."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@compiled
def turn_body(q: Array, rx: float, ry: float, rz: float) -> None:
    """q <- q exp(r), r a rotation vector in the body's frame, in place; the result is unit."""
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    s = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    c = math.cos(0.5 * angle)
    bx, by, bz = s * rx, s * ry, s * rz
    ax, ay, az, aw = q[0], q[1], q[2], q[3]
    x = aw * bx + ax * c + ay * bz - az * by
    y = aw * by - ax * bz + ay * c + az * bx
    z = aw * bz + ax * by - ay * bx + az * c
    w = aw * c - ax * bx - ay * by - az * bz
    n = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    q[0], q[1], q[2], q[3] = x * n, y * n, z * n, w * n


@compiled
def turn_stage(q: Array, rx: float, ry: float, rz: float) -> None:
    """q <- exp(r) q, r a rotation vector in the stage, in place; the result is unit."""
    # exp(r) q is the inverse of (inverse of q) exp(-r).
    q[0], q[1], q[2] = -q[0], -q[1], -q[2]
    turn_body(q, -rx, -ry, -rz)
    q[0], q[1], q[2] = -q[0], -q[1], -q[2]


@compiled
def logarithm(q: Quaternion) -> Vector:
    """The rotation vector of a unit quaternion, rad, the short way."""
    x, y, z, w = q
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, w) / sine
    return scale * x, scale * y, scale * z


@compiled
def conjugate(q: Quaternion) -> Quaternion:
    """The inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]
