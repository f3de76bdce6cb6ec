"""The extended Kalman filter of the camera's mount, compiled: a few us per picture, so that each of them may count.

Error state, shape (23,): a small turn of the correction (0:3, rad, head frame), its shift (3:6, m, head frame), the
depth's scale (6), what the lens' calibration leaves (7:11, rad at the picture's edge), the slow wander of the headset's
attitude (11:14, rad, head frame) and place (14:17, m, stage), and the points of the left (17:20) and the right target
(20:23, m, stage). The correction's turn itself is a quaternion beside it; x[0:3] stays 0.
"""

from __future__ import annotations

import numpy as np

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import (
    Matrix,
    Vector,
    cross,
    quaternion,
    rotation,
    turn_stage,
    turned,
    vector,
)
from foottrack_service.fusion.foot_filter_kernel import invert3
from foottrack_service.rotations import Array

TURN, SHIFT, SCALE, LENS, WANDER_TURN, WANDER_PLACE, POINTS, STATES = 0, 3, 6, 7, 11, 14, 17, 23
EDGE = 0.7
"""Tangent of the angle between the picture's middle and its edge; the lens' rest grows with its third power."""


NEIGHBOURS = 0.05
"""Weight of the newest in the innovations' running mean: about 20 pictures, a third of a second."""
WIDEST = 3.0
"""Squared, in units of the edge: beyond it nothing is in a picture."""


@compiled
def pass_time(x: Array, P: Array, kept: float, walks: Array) -> None:
    """The wanders keep a share ``kept`` of themselves; all variances grow by ``walks``, shape (23,)."""
    for i in range(WANDER_TURN, POINTS):
        x[i] *= kept
        for j in range(STATES):
            P[i, j] *= kept
            P[j, i] *= kept
    for i in range(STATES):
        P[i, i] += walks[i]


@compiled
def begin_point(x: Array, turn: Array, P: Array, point: int, head_p: Array, head_q: Array, p: Array) -> None:
    """The target at index ``point`` of the state stands somewhere new: where it is seen, and unknown to a metre."""
    ahead = turned(rotation(quaternion(turn, 0)), vector(p, 0))
    ahead = (ahead[0] + x[SHIFT], ahead[1] + x[SHIFT + 1], ahead[2] + x[SHIFT + 2])
    place = turned(rotation(quaternion(head_q, 0)), ahead)
    for i in range(3):
        x[point + i] = head_p[i] + place[i] - x[WANDER_PLACE + i]
        for j in range(STATES):
            P[point + i, j] = P[j, point + i] = 0.0
        P[point + i, point + i] = 1.0


@compiled
def look(
    x: Array,
    turn: Array,
    P: Array,
    point: int,
    camera_p: Array,
    camera_q: Array,
    head_p: Array,
    head_q: Array,
    p: Array,
    cov: Array,
    head_variance: float,
    gate: float,
    mean: Array,
) -> tuple[float, float]:
    """A target, whose point has index ``point``, is seen at ``p`` (head frame, m, covariance ``cov``).

    ``head_variance``, m^2 per axis, is the head pose's share. x, turn and P are updated in place unless the squared
    Mahalanobis distance, the first result, is above ``gate``. The second: that of the innovations' running ``mean``,
    (3,), which is updated.
    """
    H, S, y = np.zeros((3, STATES)), np.zeros((3, 3)), np.empty(3)
    for k in range(3):
        for m in range(3):
            S[k, m] = cov[k, m] + (head_variance if k == m else 0.0)
    known, W = _inverse(S)
    camera = rotation(quaternion(camera_q, 0))
    if not known:
        return np.inf, 0.0
    innovation(x, turn, point, vector(camera_p, 0), camera, head_p, head_q, p, head_variance, W, y, H)
    PH = np.zeros((STATES, 3))
    for i in range(STATES):
        for k in range(3):
            for j in range(STATES):
                PH[i, k] += P[i, j] * H[k, j]
    for k in range(3):
        for m in range(3):
            for j in range(STATES):
                S[k, m] += H[k, j] * PH[j, m]
    known, W = _inverse(S)
    if not known:
        return np.inf, 0.0
    weighted = turned(W, vector(y, 0))
    distance = y[0] * weighted[0] + y[1] * weighted[1] + y[2] * weighted[2]
    if not distance <= gate:
        return distance, 0.0
    change = np.empty(STATES)
    for i in range(STATES):
        change[i] = PH[i, 0] * weighted[0] + PH[i, 1] * weighted[1] + PH[i, 2] * weighted[2]
        gain = turned(W, vector(PH[i], 0))
        for j in range(i + 1):
            P[i, j] -= gain[0] * PH[j, 0] + gain[1] * PH[j, 1] + gain[2] * PH[j, 2]
            P[j, i] = P[i, j]
    turn_stage(turn, change[0], change[1], change[2])
    for i in range(SHIFT, STATES):
        x[i] += change[i]
    for k in range(3):
        mean[k] += NEIGHBOURS * (y[k] - mean[k])
    weighted = turned(W, vector(mean, 0))
    return distance, mean[0] * weighted[0] + mean[1] * weighted[1] + mean[2] * weighted[2]


@compiled
def innovation(
    x: Array,
    turn: Array,
    point: int,
    camera_p: Vector,
    camera: Matrix,
    head_p: Array,
    head_q: Array,
    p: Array,
    head_variance: float,
    W: Matrix,
    y: Array,
    H: Array,
) -> None:
    """How far ``p`` is from where the configured mount would show the point, into ``y``, m, head frame, and the
    latter's derivatives into ``H``, (3, 23). ``W``: inverse of the covariance of picture and head pose."""
    R, F = rotation(quaternion(head_q, 0)), rotation(quaternion(turn, 0))
    off = (
        x[point] - head_p[0] + x[WANDER_PLACE],
        x[point + 1] - head_p[1] + x[WANDER_PLACE + 1],
        x[point + 2] - head_p[2] + x[WANDER_PLACE + 2],
    )
    steady = turned(_transposed(R), off)
    w = cross(vector(x, WANDER_TURN), steady)
    ahead = (
        steady[0] + w[0] - x[SHIFT],
        steady[1] + w[1] - x[SHIFT + 1],
        steady[2] + w[2] - x[SHIFT + 2],
    )
    configured = turned(_transposed(F), ahead)
    ray = (configured[0] - camera_p[0], configured[1] - camera_p[1], configured[2] - camera_p[2])
    _bend(ray, camera, H)
    for i in range(3):
        y[i] = p[i] - camera_p[i] - (1.0 + x[SCALE]) * ray[i]
        for k in range(LENS, WANDER_TURN):
            y[i] -= H[i, k] * x[k]
    # The derivatives are taken where picture and head pose together have the target. Elsewhere the noise of one of them
    # would be in them as it is in y, and pass for a scale: 0.1 %, and 2 mm of shift.
    d = turned(W, vector(y, 0))
    d = (head_variance * d[0], head_variance * d[1], head_variance * d[2])
    ray = (ray[0] + d[0], ray[1] + d[1], ray[2] + d[2])
    _bend(ray, camera, H)
    d = turned(F, d)
    far = max(steady[0] * steady[0] + steady[1] * steady[1] + steady[2] * steady[2], 1e-4)
    n = cross(steady, d)
    n = (n[0] / far, n[1] / far, n[2] / far)
    ahead = (ahead[0] + d[0], ahead[1] + d[1], ahead[2] + d[2])
    steady = (steady[0] + d[0], steady[1] + d[1], steady[2] + d[2])
    size = 1.0 + x[SCALE]
    for i in range(3):
        f = (size * F[0][i], size * F[1][i], size * F[2][i])
        # f . (v x d) = v . (d x f)
        turns, wanders = cross(f, ahead), cross(steady, f)
        back = cross(n, f)
        along = turned(R, (f[0] - back[0], f[1] - back[1], f[2] - back[2]))
        H[i, SCALE] = ray[i]
        for k in range(3):
            H[i, TURN + k] = turns[k]
            H[i, SHIFT + k] = -f[k]
            H[i, WANDER_TURN + k] = wanders[k]
            H[i, WANDER_PLACE + k] = along[k]
            H[i, point + k] = along[k]


@compiled
def _bend(ray: Vector, camera: Matrix, H: Array) -> None:
    """What the lens' rest does to a target at ``ray`` from the camera, m, head frame: its columns of H."""
    seen = turned(_transposed(camera), ray)
    depth = max(-seen[2], 0.05)
    a, b = seen[0] / (depth * EDGE), seen[1] / (depth * EDGE)
    bent = min(a * a + b * b, WIDEST) * depth
    for i in range(3):
        for k in range(2):
            H[i, LENS + k] = camera[i][k] * bent * a
            H[i, LENS + 2 + k] = camera[i][k] * bent * b


@compiled
def _inverse(S: Array) -> tuple[bool, Matrix]:
    return invert3(((S[0, 0], S[0, 1], S[0, 2]), (S[1, 0], S[1, 1], S[1, 2]), (S[2, 0], S[2, 1], S[2, 2])))


@compiled
def _transposed(A: Matrix) -> Matrix:
    return (A[0][0], A[1][0], A[2][0]), (A[0][1], A[1][1], A[2][1]), (A[0][2], A[1][2], A[2][2])
