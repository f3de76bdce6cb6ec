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

from foottrack_service.fusion.compiled import compiled
from foottrack_service.rotations import Array

NX = 17
NE = 16
GRAVITY = 9.80665

ACC_NOISE = 0.02
"""m/s^2/sqrt(Hz): a good sensor has 0.002; the rest is vibration and misalignment at rest."""
ACC_SCALE = 0.004
"""1/sqrt(Hz): what a moving foot adds per m/s^2 that is felt beyond gravity (scale factor, soft mounting)."""
ACC_STEP = 0.02
"""1/sqrt(Hz): per m/s^2 that two neighbouring samples differ by: what happened between them is a guess."""
ACC_CLIPPED = 2.0
"""m/s^2/sqrt(Hz) while the accelerometer is at its end."""
GYRO_NOISE = 0.001
"""rad/s/sqrt(Hz)."""
GYRO_SCALE = 0.0005
"""1/sqrt(Hz), per rad/s: scale factor and misalignment."""
FUSED_TILT = 0.02
"""rad/sqrt(s) that a device's own idea of what is upright adds while it moves: 1.4 deg that change within 2 s."""
FULL_EFFORT = 5.0
"""m/s^2 beyond gravity at which all of that is there."""
ACC_BIAS_WALK = 0.0005
"""m/s^2/sqrt(s)."""
GYRO_BIAS_WALK = 0.00002
"""rad/s/sqrt(s)."""
DELAY_WALK = 0.0001
"""s/sqrt(s)."""


@compiled
def rotation(q: Array, R: Array) -> None:
    """Write the matrix of q, shape (4,), into R, shape (3, 3)."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    R[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[0, 1] = 2.0 * (x * y - z * w)
    R[0, 2] = 2.0 * (x * z + y * w)
    R[1, 0] = 2.0 * (x * y + z * w)
    R[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[1, 2] = 2.0 * (y * z - x * w)
    R[2, 0] = 2.0 * (x * z - y * w)
    R[2, 1] = 2.0 * (y * z + x * w)
    R[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@compiled
def turned(R: Array, v: Array) -> Array:
    """R v, shape (3,)."""
    out = np.empty(3)
    for i in range(3):
        out[i] = R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2]
    return out


@compiled
def product(a: Array, b: Array) -> Array:
    """Hamilton product of two quaternions, shape (4,): first b turns, then a."""
    out = np.empty(4)
    out[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1]
    out[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0]
    out[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3]
    out[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]
    return out


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
def propagate(x: Array, P: Array, acc: Array, gyro: Array, step: float, clipped: bool, fused: bool, dt: float) -> None:
    """Carry x and P forward by dt, s, in place.

    ``acc`` (m/s^2) and ``gyro`` (rad/s), shape (3,), are means over the interval, ``step`` (m/s^2) is how far the
    specific force moved within it. ``fused``: the rate is the increment of the device's own attitude.
    """
    q = x[6:10]
    fx, fy, fz = acc[0] - x[10], acc[1] - x[11], acc[2] - x[12]
    wx, wy, wz = gyro[0] - x[13], gyro[1] - x[14], gyro[2] - x[15]
    turn_body(q, 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz)
    R = np.empty((3, 3))
    rotation(q, R)
    turn_body(q, 0.5 * dt * wx, 0.5 * dt * wy, 0.5 * dt * wz)
    gx = R[0, 0] * fx + R[0, 1] * fy + R[0, 2] * fz
    gy = R[1, 0] * fx + R[1, 1] * fy + R[1, 2] * fz
    gz = R[2, 0] * fx + R[2, 1] * fy + R[2, 2] * fz
    ax, ay, az = gx, gy - GRAVITY, gz
    half = 0.5 * dt * dt
    x[0] += x[3] * dt + ax * half
    x[1] += x[4] * dt + ay * half
    x[2] += x[5] * dt + az * half
    x[3] += ax * dt
    x[4] += ay * dt
    x[5] += az * dt

    # da/dtheta = -[g]x, da/dba = -R, dtheta/dbg = -R dt
    for j in range(NE):
        t0, t1, t2 = P[6, j], P[7, j], P[8, j]
        b0, b1, b2 = P[9, j], P[10, j], P[11, j]
        a0 = gz * t1 - gy * t2 - (R[0, 0] * b0 + R[0, 1] * b1 + R[0, 2] * b2)
        a1 = gx * t2 - gz * t0 - (R[1, 0] * b0 + R[1, 1] * b1 + R[1, 2] * b2)
        a2 = gy * t0 - gx * t1 - (R[2, 0] * b0 + R[2, 1] * b1 + R[2, 2] * b2)
        P[0, j] += dt * P[3, j] + half * a0
        P[1, j] += dt * P[4, j] + half * a1
        P[2, j] += dt * P[5, j] + half * a2
        P[3, j] += dt * a0
        P[4, j] += dt * a1
        P[5, j] += dt * a2
        w0, w1, w2 = P[12, j], P[13, j], P[14, j]
        P[6, j] -= dt * (R[0, 0] * w0 + R[0, 1] * w1 + R[0, 2] * w2)
        P[7, j] -= dt * (R[1, 0] * w0 + R[1, 1] * w1 + R[1, 2] * w2)
        P[8, j] -= dt * (R[2, 0] * w0 + R[2, 1] * w1 + R[2, 2] * w2)
    for i in range(NE):
        t0, t1, t2 = P[i, 6], P[i, 7], P[i, 8]
        b0, b1, b2 = P[i, 9], P[i, 10], P[i, 11]
        a0 = gz * t1 - gy * t2 - (R[0, 0] * b0 + R[0, 1] * b1 + R[0, 2] * b2)
        a1 = gx * t2 - gz * t0 - (R[1, 0] * b0 + R[1, 1] * b1 + R[1, 2] * b2)
        a2 = gy * t0 - gx * t1 - (R[2, 0] * b0 + R[2, 1] * b1 + R[2, 2] * b2)
        P[i, 0] += dt * P[i, 3] + half * a0
        P[i, 1] += dt * P[i, 4] + half * a1
        P[i, 2] += dt * P[i, 5] + half * a2
        P[i, 3] += dt * a0
        P[i, 4] += dt * a1
        P[i, 5] += dt * a2
        w0, w1, w2 = P[i, 12], P[i, 13], P[i, 14]
        P[i, 6] -= dt * (R[0, 0] * w0 + R[0, 1] * w1 + R[0, 2] * w2)
        P[i, 7] -= dt * (R[1, 0] * w0 + R[1, 1] * w1 + R[1, 2] * w2)
        P[i, 8] -= dt * (R[2, 0] * w0 + R[2, 1] * w1 + R[2, 2] * w2)

    felt = math.sqrt(ax * ax + ay * ay + az * az)
    rate = math.sqrt(wx * wx + wy * wy + wz * wz)
    sigma_a = ACC_NOISE + ACC_SCALE * felt + ACC_STEP * step + (ACC_CLIPPED if clipped else 0.0)
    sigma_w = GYRO_NOISE + GYRO_SCALE * rate
    sigma_yaw = sigma_w
    if fused:
        sigma_w += FUSED_TILT * min(1.0, felt / FULL_EFFORT)
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
def invert3(S: Array, inverse: Array) -> bool:
    """Inverse of a symmetric positive definite matrix, shape (3, 3); False where it is none."""
    a, b, c, d, e, f = S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2]
    ca, cb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    det = a * ca + b * cb + c * cc
    if not (a > 0.0 and a * d - b * b > 0.0 and det > 0.0):
        return False
    inverse[0, 0] = ca / det
    inverse[0, 1] = inverse[1, 0] = cb / det
    inverse[0, 2] = inverse[2, 0] = cc / det
    inverse[1, 1] = (a * f - c * c) / det
    inverse[1, 2] = inverse[2, 1] = (b * c - a * e) / det
    inverse[2, 2] = (a * d - b * b) / det
    return True


@compiled
def inject(x: Array, d: Array) -> None:
    """Put the error d, shape (16,), into the nominal state, in place."""
    for i in range(6):
        x[i] += d[i]
    turn_stage(x[6:10], d[6], d[7], d[8])
    for i in range(7):
        x[10 + i] += d[9 + i]


@compiled
def update3(x: Array, P: Array, H: Array, innovation: Array, S_noise: Array, gate: float) -> float:
    """Measurement of three components, H of shape (3, 16), its noise of shape (3, 3), in place.

    Returns the squared Mahalanobis distance; nothing is changed when that is above ``gate`` or is not finite.
    """
    PH = np.zeros((NE, 3))
    for j in range(NE):
        for m in range(3):
            h = H[m, j]
            if h != 0.0:
                for i in range(NE):
                    PH[i, m] += P[i, j] * h
    S = S_noise.copy()
    for m in range(3):
        for n in range(3):
            for i in range(NE):
                S[m, n] += H[m, i] * PH[i, n]
    inverse = np.empty((3, 3))
    if not invert3(S, inverse):
        return math.inf
    y = inverse @ innovation
    distance = float(innovation[0] * y[0] + innovation[1] * y[1] + innovation[2] * y[2])
    if not distance <= gate:
        return distance if distance == distance else math.inf
    d = PH @ y
    K = PH @ inverse
    for i in range(NE):
        for j in range(i, NE):
            change = K[i, 0] * PH[j, 0] + K[i, 1] * PH[j, 1] + K[i, 2] * PH[j, 2]
            P[i, j] -= change
            P[j, i] = P[i, j]
    inject(x, d)
    return distance


@compiled
def update1(x: Array, P: Array, h: Array, innovation: float, noise: float, gate: float) -> float:
    """Measurement of one component, h of shape (16,), its variance ``noise``; else as ``update3``."""
    ph = np.zeros(NE)
    for j in range(NE):
        if h[j] != 0.0:
            for i in range(NE):
                ph[i] += P[i, j] * h[j]
    S = noise
    for i in range(NE):
        S += h[i] * ph[i]
    if not S > 0.0:
        return math.inf
    distance = innovation * innovation / S
    if not distance <= gate:
        return distance if distance == distance else math.inf
    for i in range(NE):
        for j in range(i, NE):
            P[i, j] -= ph[i] * ph[j] / S
            P[j, i] = P[i, j]
    inject(x, ph * (innovation / S))
    return distance


@compiled
def floor_covariance(P: Array, smallest: Array) -> None:
    """No variance below ``smallest``, shape (16,): rounding and too many agreeing fixes make none certain."""
    for i in range(NE):
        if P[i, i] < smallest[i]:
            P[i, i] = smallest[i]
