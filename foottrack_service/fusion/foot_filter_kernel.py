"""The error-state Kalman filter of one foot: propagation and updates, compiled.

Nominal state x, shape (17,), of the *sensor*: p (0:3, m, stage), v (3:6, m/s, stage), q (6:10, sensor to stage),
accelerometer bias (10:13, m/s^2, sensor), gyro bias (13:16, rad/s, sensor), camera-to-IMU time offset (16, s).
Error state, shape (16,): dp, dv, dtheta (a small turn in the *stage*: R = exp(dtheta) R_nominal, so a device's
arbitrary yaw is dtheta_y alone), dba, dbg, dtd. P is its covariance, shape (16, 16).

Method: J. Sola, Quaternion kinematics for the error-state Kalman filter (2017), global angular errors.
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import (
    Matrix,
    Vector,
    quaternion,
    rotation,
    turn_body,
    turn_stage,
    turned,
)
from foottrack_service.rotations import Array

NX = 17
NE = 16
GRAVITY = 9.80665

ACC_NOISE = 0.01
"""m/s^2/sqrt(Hz): a good sensor has 0.002; the rest is vibration and misalignment at rest. (With twice as much here and
below, a swing's velocity was five times surer than it said, and blobs and false tags had their way.)"""
ACC_SCALE = 0.002
"""1/sqrt(Hz): what a moving foot adds per m/s^2 that is felt beyond gravity (scale factor, soft mounting)."""
ACC_STEP = 0.02
"""1/sqrt(Hz): per m/s^2 that two neighbouring samples differ by: what happened between them is a guess."""
ACC_CLIPPED = 2.0
"""m/s^2/sqrt(Hz) while the accelerometer is at its end."""
GYRO_NOISE = 0.001
"""rad/s/sqrt(Hz)."""
GYRO_SCALE, GYRO_TILT_SCALE = 0.0005, 0.002
"""1/sqrt(Hz), per rad/s: scale factor and misalignment; the second is what it does to the tilt beside that, which the
next stance shows. (A yaw that is less sure is turned by what passes for zero velocity, and nothing turns it back.)"""
ACC_BIAS_WALK = 0.0005
"""m/s^2/sqrt(s)."""
GYRO_BIAS_WALK = 0.0001
"""rad/s/sqrt(s): a real one drifts by 0.04 deg/s while its sensor warms up for 10 s."""
DELAY_WALK = 0.0001
"""s/sqrt(s)."""
FASTEST, UNKNOWN_SPEED = 20.0, 3.0
"""m/s: a sprinter's foot; SD of a foot of whose speed nothing is known."""
ACC_BIAS, LARGEST_ACC_BIAS = 0.2, 0.6
"""m/s^2 per axis: data sheets allow 0.17 to 0.2 (who believes less never learns it, and loses centimetres in a swing);
and norm beyond which it was no bias that was learned, but a fault."""
ZERO_GATE = 30.0
"""A stance never overrules a velocity that is clearly known: chi-square, 3 degrees of freedom."""
LONGEST_DELAY_S = 0.05
SMALLEST, SMALLEST_OF_GYRO_BIAS = 1e-8, 1e-14
"""Below which no variance falls, in the units of each."""


@compiled
def bound(x: Array, P: Array) -> None:
    """No foot is faster than FASTEST, no camera later than LONGEST_DELAY_S and no accelerometer off by more than
    LARGEST_ACC_BIAS: who says so knows nothing of it."""
    x[16] = min(max(x[16], -LONGEST_DELAY_S), LONGEST_DELAY_S)
    bias2 = x[10] * x[10] + x[11] * x[11] + x[12] * x[12]
    if bias2 > LARGEST_ACC_BIAS**2:
        for k in range(9, 12):
            x[1 + k] = 0.0
            for j in range(NE):
                P[k, j] = 0.0
                P[j, k] = 0.0
            P[k, k] = ACC_BIAS**2
        # What was wrong with it the tilt has learned half of.
        P[6, 6] += bias2 / GRAVITY**2
        P[8, 8] += bias2 / GRAVITY**2
    if x[3] * x[3] + x[4] * x[4] + x[5] * x[5] <= FASTEST**2:
        return
    for k in range(3, 6):
        x[k] = 0.0
        for j in range(NE):
            P[k, j] = 0.0
            P[j, k] = 0.0
        P[k, k] = UNKNOWN_SPEED**2


@compiled
def propagate(
    x: Array, P: Array, acc: Vector, gyro: Vector, step: float, clipped: bool, wander: float, dt: float
) -> None:
    """Carry x and P forward by dt, s, in place.

    ``acc`` (m/s^2) and ``gyro`` (rad/s) are means over the interval, ``step`` (m/s^2) is how far the specific force
    moved within it. ``wander``, rad/sqrt(s): what the tilt is unsure by beyond a gyro's noise.
    """
    q = x[6:10]
    f = (acc[0] - x[10], acc[1] - x[11], acc[2] - x[12])
    wx, wy, wz = gyro[0] - x[13], gyro[1] - x[14], gyro[2] - x[15]
    turn_body(q, 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz)
    R = rotation(quaternion(x, 6))
    turn_body(q, 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz)
    g = turned(R, f)
    ax, ay, az = g[0], g[1] - GRAVITY, g[2]
    half = 0.5 * dt * dt
    x[0] += x[3] * dt + ax * half
    x[1] += x[4] * dt + ay * half
    x[2] += x[5] * dt + az * half
    x[3] += ax * dt
    x[4] += ay * dt
    x[5] += az * dt
    # P is symmetric: F P F' = F (F P)'
    rows = P.reshape(NE * NE)
    _carry(rows, R, g, dt)
    _transpose(rows)
    _carry(rows, R, g, dt)

    felt = math.sqrt(ax * ax + ay * ay + az * az)
    rate = math.sqrt(wx * wx + wy * wy + wz * wz)
    sigma_a = ACC_NOISE + ACC_SCALE * felt + ACC_STEP * step + (ACC_CLIPPED if clipped else 0.0)
    sigma_w = GYRO_NOISE + GYRO_SCALE * rate
    sigma_yaw = sigma_w
    sigma_w += GYRO_TILT_SCALE * rate + wander
    qa = sigma_a * sigma_a * dt
    for i in range(3):
        P[i, i] += qa * dt * dt / 3.0
        P[i, 3 + i] += qa * dt / 2.0
        P[3 + i, i] += qa * dt / 2.0
        P[3 + i, 3 + i] += qa
        P[6 + i, 6 + i] += dt * (sigma_yaw * sigma_yaw if i == 1 else sigma_w * sigma_w)
        P[9 + i, 9 + i] += ACC_BIAS_WALK * ACC_BIAS_WALK * dt
        P[12 + i, 12 + i] += GYRO_BIAS_WALK * GYRO_BIAS_WALK * dt
    P[15, 15] += DELAY_WALK * DELAY_WALK * dt


@compiled
def invert3(S: Matrix) -> tuple[bool, Matrix]:
    """Whether a symmetric matrix, of which only the upper half is read, is positive definite, and its inverse."""
    (a, b, c), (_, d, e), (_, _, f) = S
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    det = a * ca + b * cb + c * cc
    if not (a > 0.0 and a * d - b * b > 0.0 and det > 0.0):
        return False, S
    ia, ib, ic, id_, ie, if_ = (
        ca / det,
        cb / det,
        cc / det,
        (a * f - c * c) / det,
        (b * c - a * e) / det,
        (a * d - b * b) / det,
    )
    return True, ((ia, ib, ic), (ib, id_, ie), (ic, ie, if_))


@compiled
def inject(x: Array, d: Array) -> None:
    """Put the error d, shape (16,), into the nominal state, in place."""
    for i in range(6):
        x[i] += d[i]
    turn_stage(x[6:10], d[6], d[7], d[8])
    for i in range(7):
        x[10 + i] += d[9 + i]


@compiled
def seen_through(P: Array, H: Array, noise: Array, PH: Array) -> Matrix:
    """H P, shape (3, 16), into PH; returns the innovation's covariance H P H' + noise."""
    S = noise.copy()
    PH[:] = 0.0
    for m in range(3):
        for j in range(NE):
            h = H[m, j]
            if h != 0.0:
                for i in range(NE):
                    PH[m, i] += P[j, i] * h
    for m in range(3):
        for i in range(NE):
            h = H[m, i]
            if h != 0.0:
                for n in range(m, 3):
                    S[m, n] += h * PH[n, i]
    return (S[0, 0], S[0, 1], S[0, 2]), (S[0, 1], S[1, 1], S[1, 2]), (S[0, 2], S[1, 2], S[2, 2])


@compiled
def update3(x: Array, P: Array, H: Array, innovation: Vector, noise: Array, gate: float) -> float:
    """Measurement of three components, H of shape (3, 16), its noise of shape (3, 3), in place.

    Returns the squared Mahalanobis distance; nothing is changed when that is above ``gate`` or is not finite.
    """
    PH = np.empty((3, NE))
    S = seen_through(P, H, noise, PH)
    return _fuse3(x, P, PH, S, innovation, gate)


@compiled
def update_speed(x: Array, P: Array, speed: Vector, variance: float, gate: float) -> float:
    """The velocity is ``speed``, m/s, stage, with this variance per axis, (m/s)^2; else as ``update3``."""
    PH = P[3:6].copy()
    return _fuse3(x, P, PH, _covariance(P, 3, variance), _off(x, 3, speed), gate)


@compiled
def update_gyro_bias(x: Array, P: Array, bias: Vector, variance: float, gate: float) -> float:
    """The gyro's bias is ``bias``, rad/s, sensor frame, with this variance per axis, (rad/s)^2; else as ``update3``."""
    PH = P[12:15].copy()
    return _fuse3(x, P, PH, _covariance(P, 12, variance), _off(x, 13, bias), gate)


@compiled
def speed_distance(x: Array, P: Array, speed: Vector, variance: float) -> float:
    """Squared Mahalanobis distance of the velocity from ``speed``, as ``update_speed`` has it; inf without one."""
    found, inverse = invert3(_covariance(P, 3, variance))
    off = _off(x, 3, speed)
    y = turned(inverse, off)
    return off[0] * y[0] + off[1] * y[1] + off[2] * y[2] if found else math.inf


@compiled
def update1(x: Array, P: Array, h: Array, innovation: float, noise: float, gate: float) -> float:
    """Measurement of one component, h of shape (16,), its variance ``noise``; else as ``update3``."""
    ph = np.zeros(NE)
    S = noise
    for j in range(NE):
        if h[j] != 0.0:
            for i in range(NE):
                ph[i] += P[j, i] * h[j]
    for i in range(NE):
        if h[i] != 0.0:
            S += h[i] * ph[i]
    if not S > 0.0:
        return math.inf
    distance = innovation * innovation / S
    if not distance <= gate:
        return distance if distance == distance else math.inf
    for i in range(NE):
        k = ph[i] / S
        for j in range(i, NE):
            P[i, j] -= k * ph[j]
    _mirror(P.reshape(NE * NE))
    for i in range(NE):
        ph[i] *= innovation / S
    inject(x, ph)
    return distance


@compiled
def floor_covariance(P: Array) -> None:
    """No variance below SMALLEST: rounding and too many agreeing fixes make none certain."""
    for i in range(NE):
        smallest = SMALLEST_OF_GYRO_BIAS if 12 <= i < 15 else SMALLEST
        if P[i, i] < smallest:
            P[i, i] = smallest


@compiled
def _covariance(P: Array, i: int, variance: float) -> Matrix:
    return (
        (P[i, i] + variance, P[i, i + 1], P[i, i + 2]),
        (P[i + 1, i], P[i + 1, i + 1] + variance, P[i + 1, i + 2]),
        (P[i + 2, i], P[i + 2, i + 1], P[i + 2, i + 2] + variance),
    )


@compiled
def _off(x: Array, i: int, measured: Vector) -> Vector:
    return measured[0] - x[i], measured[1] - x[i + 1], measured[2] - x[i + 2]


@compiled
def _fuse3(x: Array, P: Array, PH: Array, S: Matrix, innovation: Vector, gate: float) -> float:
    found, inverse = invert3(S)
    if not found:
        return math.inf
    y = turned(inverse, innovation)
    distance = innovation[0] * y[0] + innovation[1] * y[1] + innovation[2] * y[2]
    if not distance <= gate:
        return distance if distance == distance else math.inf
    d = np.empty(NE)
    for i in range(NE):
        column = (PH[0, i], PH[1, i], PH[2, i])
        d[i] = column[0] * y[0] + column[1] * y[1] + column[2] * y[2]
        k = turned(inverse, column)
        for j in range(i, NE):
            P[i, j] -= k[0] * PH[0, j] + k[1] * PH[1, j] + k[2] * PH[2, j]
    _mirror(P.reshape(NE * NE))
    inject(x, d)
    return distance


@compiled
def _carry(p: Array, R: Matrix, g: Vector, dt: float) -> None:
    """F P in place, p the rows of P in one line, shape (256,): so the compiler sees that they do not overlap."""
    half = 0.5 * dt * dt
    for j in range(NE):
        v0, v1, v2 = p[48 + j], p[64 + j], p[80 + j]
        t0, t1, t2 = p[96 + j], p[112 + j], p[128 + j]
        b = turned(R, (p[144 + j], p[160 + j], p[176 + j]))
        w = turned(R, (p[192 + j], p[208 + j], p[224 + j]))
        # da/dtheta = -[g]x, da/dba = -R, dtheta/dbg = -R dt
        a0 = g[2] * t1 - g[1] * t2 - b[0]
        a1 = g[0] * t2 - g[2] * t0 - b[1]
        a2 = g[1] * t0 - g[0] * t1 - b[2]
        p[j] += dt * v0 + half * a0
        p[16 + j] += dt * v1 + half * a1
        p[32 + j] += dt * v2 + half * a2
        p[48 + j] = v0 + dt * a0
        p[64 + j] = v1 + dt * a1
        p[80 + j] = v2 + dt * a2
        p[96 + j] = t0 - dt * w[0]
        p[112 + j] = t1 - dt * w[1]
        p[128 + j] = t2 - dt * w[2]


@compiled
def _transpose(p: Array) -> None:
    for i in range(1, NE):
        for j in range(i):
            p[NE * i + j], p[NE * j + i] = p[NE * j + i], p[NE * i + j]


@compiled
def _mirror(p: Array) -> None:
    """What is above the diagonal goes below it."""
    for i in range(1, NE):
        for j in range(i):
            p[NE * i + j] = p[NE * j + i]
