"""The filter over a timeline: from one checkpoint through the events after it, compiled.

One function serves a new sample (one event) and a late fix (all events since it), so there is no second way.
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import (
    Vector,
    cross,
    quaternion,
    rotation,
    squared,
    turn_stage,
    turned,
    vector,
)
from foottrack_service.fusion.foot_filter_events import (
    ACC,
    ACCEPTED,
    ARM,
    CLIPPED,
    FLOOR,
    GYRO,
    IMU,
    KIND,
    MEAN_RATE,
    MEASURED_Q,
    POINT,
    POINT_SIGMA,
    RESET,
    REST_RATE,
    REST_S,
    ROLL,
    SPEED,
    SPEED_SIGMA,
    TILT_SIGMA,
    TURN_SIGMA,
    UP,
    WANDER,
    WHOLE,
    WRONG_SPEED,
    WRONG_TILT,
    YAW_SIGMA,
    ZERO_SIGMA,
)
from foottrack_service.fusion.foot_filter_kernel import (
    GRAVITY,
    NE,
    NX,
    ZERO_GATE,
    bound,
    floor_covariance,
    propagate,
    update1,
    update_gyro_bias,
    update_speed,
)
from foottrack_service.fusion.foot_filter_memory import Foot
from foottrack_service.fusion.foot_filter_models import fix_updates
from foottrack_service.rotations import Array

GAP_S, GAP_SHARE = 0.045, 0.5
"""Between two samples that are further apart a share of the turn is a guess, or the clock was put forward and there was
none."""
HOLE_S = 0.1
"""A longer silence of the IMU is not integrated across."""
HOLE_SPEED = 1.5
"""m/s SD: what a foot does meanwhile."""
HOLE_FADE_S = 0.15
"""How soon a foot that nobody measures has forgotten its speed."""
HOLE_WALK, FUSED_HOLE_WALK = 0.7, 0.03
"""rad/sqrt(s): how a yaw that nobody measures wanders; and the attitude of a device which keeps its own."""
HOLE_TILT, HOLE_TILT_FADE_S = 0.45, 0.3
"""rad per axis: how much a foot leans that nobody measures, and how soon it has forgotten how it leant: mostly it is
flat, and half a radian off is easier to mend than what it was off by in the middle of a swing."""
LONGEST_HOLE_S = 1.0
FLOOR_GATE = 12.0
FLOOR_SIGMA = 0.005
"""m, of a standing ankle's height."""
FLOOR_UNSEEN, FLOOR_NEAR = 0.006, 0.08
"""m: a height that is less sure has seen no picture lately, and drift is a likelier reason for being so near to the
floor than a stair. Held against the height's own sigma: one sample's weight is far less than what a stance is worth."""
FLOOR_LEAN = 0.9
"""Cosine: a foot that leans more stands on its heel or toes, and the ankle's height says nothing."""
WRONG_FOR_S = 1.0
"""For so long a speed may have been wrong that a resting foot shows to be."""
BIAS_SIGMA = 0.006
"""rad/s per 10 ms: how little a quiet foot turns."""
BIAS_GATE = 100.0
"""Chi-square, 3 degrees of freedom: what turns much faster than its gyro can be off by does not rest."""
UP_SIGMA = 0.04
"""rad: the device's own tilt."""
UP_CORRELATED_S = 2.0
"""For so long it has the same error."""
LEVEL_SIGMA = 0.05
"""rad: the tilt of the specific force of a foot at rest."""
LEVEL_BELOW = 0.05
"""rad: who knows the tilt better than this does not ask the specific force."""


@compiled
def replay(s: Foot, start: int, end: int) -> None:
    """States and covariances after the events ``start`` .. ``end`` - 1 from the one before. ``start`` is at least 1."""
    t, rows = s.t[:], s.rows[:]
    for i in range(start, end):
        x, P, row = s.X[i], s.P[i], rows[i]
        for j in range(NX):
            x[j] = s.X[i - 1, j]
        for j in range(NE):
            for k in range(NE):
                P[j, k] = s.P[i - 1, j, k]
        dt = (t[i] - t[i - 1]) * 1e-9
        if dt > 0.0:
            _advance(s, x, P, i, end, dt)
        if row[KIND] == IMU:
            _inertial_updates(s, row, x, P, min(dt, HOLE_S))
        elif row[KIND] == RESET:
            _reset(row, x, P)
        elif row[ACCEPTED] > 0.0:
            fix_updates(row, x, P, _rate(rows, x, i, end))
        bound(x, P)
        floor_covariance(P)


@compiled
def _neighbour(rows: Array, i: int, step: int, end: int) -> int:
    j = i + step
    while 0 <= j < end:
        if rows[j, KIND] == IMU:
            return j
        j += step
    return -1


@compiled
def _rate(rows: Array, x: Array, i: int, end: int) -> Vector:
    """The turning at event i, rad/s, sensor frame, of the IMU row next to it."""
    j = _neighbour(rows, i, 1, end)
    if j < 0:
        j = _neighbour(rows, i, -1, end)
    if j < 0:
        return 0.0, 0.0, 0.0
    return rows[j, GYRO] - x[13], rows[j, GYRO + 1] - x[14], rows[j, GYRO + 2] - x[15]


@compiled
def _advance(s: Foot, x: Array, P: Array, i: int, end: int, dt: float) -> None:
    """Carry the state over the dt before event i."""
    t, rows = s.t[:], s.rows[:]
    before = _neighbour(rows, i, -1, end)
    after = i if rows[i, KIND] == IMU else _neighbour(rows, i, 1, end)
    if after < 0:
        after = before
    if before < 0:
        before = after
    if before < 0:
        return
    held = after if rows[after, MEAN_RATE] == 1.0 else before
    acc = _middle(vector(rows[before], ACC), vector(rows[after], ACC))
    gyro = _middle(vector(rows[held], GYRO), vector(rows[after], GYRO))
    step = 0.0
    for k in range(3):
        step += squared(rows[after, ACC + k] - rows[before, ACC + k])
    fused = rows[after, MEAN_RATE] == 1.0
    if (t[after] - t[before]) * 1e-9 <= HOLE_S and dt <= HOLE_S:
        clipped = rows[before, CLIPPED] == 1.0 or rows[after, CLIPPED] == 1.0
        propagate(x, P, acc, gyro, math.sqrt(step), clipped, rows[after, WANDER], dt)
        gap = (t[after] - t[before]) * 1e-9
        if gap > GAP_S:
            w2 = max(_square(vector(rows[before], GYRO)), _square(vector(rows[after], GYRO)))
            for k in range(6, 9):
                P[k, k] += w2 * GAP_SHARE**2 * gap * dt
    else:
        _coast(x, P, vector(s.foot_up, 0), gyro, fused, dt)


@compiled
def _square(a: Vector) -> float:
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


@compiled
def _middle(a: Vector, b: Vector) -> Vector:
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


@compiled
def _coast(x: Array, P: Array, up: Vector, gyro: Vector, fused: bool, dt: float) -> None:
    """Across a hole: the speed fades and wanders; a device with an attitude of its own still tells the turn.

    Without one the tilt fades and wanders too; ``up`` is the foot's own, sensor frame.
    """
    if fused:
        turn = turned(rotation(quaternion(x, 6)), gyro)
        turn_stage(x[6:10], turn[0] * dt, turn[1] * dt, turn[2] * dt)
    else:
        _flatten(x, P, up, math.exp(-dt / HOLE_TILT_FADE_S))
    fade = math.exp(-dt / HOLE_FADE_S)
    reach = HOLE_FADE_S * (1.0 - fade)
    for k in range(3):
        x[k] += reach * x[3 + k]
        x[3 + k] *= fade
        for j in range(NE):
            P[k, j] += reach * P[3 + k, j]
            P[3 + k, j] *= fade
    for k in range(3):
        for j in range(NE):
            P[j, k] += reach * P[j, 3 + k]
            P[j, 3 + k] *= fade
    capped = min(dt, LONGEST_HOLE_S)
    for k in range(3):
        P[k, k] += 2.0 * HOLE_SPEED**2 * HOLE_FADE_S * max(capped - reach, 0.0)
        P[3 + k, 3 + k] += HOLE_SPEED**2 * (1.0 - fade * fade)
        if fused or k == 1:
            P[6 + k, 6 + k] += capped * (FUSED_HOLE_WALK if fused else HOLE_WALK) ** 2


@compiled
def _flatten(x: Array, P: Array, up: Vector, fade: float) -> None:
    """The foot's tilt fades to this share of itself."""
    u = turned(rotation(quaternion(x, 6)), up)
    sine = math.sqrt(u[0] * u[0] + u[2] * u[2])
    if sine > 1e-9:
        turn = (1.0 - fade) * math.atan2(sine, u[1]) / sine
        turn_stage(x[6:10], -turn * u[2], 0.0, turn * u[0])
    for k in (6, 8):
        for j in range(NE):
            P[k, j] *= fade
        for j in range(NE):
            P[j, k] *= fade
        P[k, k] += HOLE_TILT**2 * (1.0 - fade * fade)


@compiled
def _inertial_updates(s: Foot, row: Array, x: Array, P: Array, dt: float) -> None:
    """What a sample says beyond its motion: zero velocity, the floor, the gyro's bias, up."""
    if dt <= 0.0:
        return
    h = np.zeros(NE)
    sigma = row[ZERO_SIGMA]
    if sigma > 0.0:
        _doubt(row, P)
        held = update_speed(x, P, _rolling(s, row, x), sigma * sigma * 0.01 / dt, ZERO_GATE) <= ZERO_GATE
        if held and row[FLOOR] == row[FLOOR]:
            R = rotation(quaternion(x, 6))
            up = turned(R, vector(s.foot_up, 0))
            if up[1] > FLOOR_LEAN:
                r = turned(R, vector(s.ankle_arm, 0))
                off = row[FLOOR] - x[1] - r[1]
                reach = math.sqrt(FLOOR_GATE * (P[1, 1] + squared(FLOOR_SIGMA + sigma)))
                if P[1, 1] > FLOOR_UNSEEN**2:
                    reach = max(reach, FLOOR_NEAR)
                if abs(off) <= reach:
                    h[:] = 0.0
                    h[1], h[6], h[8] = 1.0, -r[2], r[0]
                    update1(x, P, h, off, squared(FLOOR_SIGMA + sigma) * 0.1 / dt, np.inf)
        if row[REST_S] > 0.0:
            update_gyro_bias(x, P, vector(row, REST_RATE), BIAS_SIGMA**2 * 0.01 / row[REST_S], BIAS_GATE)
        if max(P[6, 6], P[8, 8]) > LEVEL_BELOW**2:
            up = (row[ACC] / GRAVITY, row[ACC + 1] / GRAVITY, row[ACC + 2] / GRAVITY)
            _level(up, LEVEL_SIGMA**2 * 0.1 / dt, x, P)
    if row[UP] != 0.0 or row[UP + 1] != 0.0 or row[UP + 2] != 0.0:
        _level(vector(row, UP), UP_SIGMA**2 * UP_CORRELATED_S / dt, x, P)


@compiled
def _doubt(row: Array, P: Array) -> None:
    """What a foot that rests has shown to be wrong is known by no more than that."""
    if row[WRONG_TILT] > 0.0:
        P[6, 6] += squared(row[WRONG_TILT])
        P[8, 8] += squared(row[WRONG_TILT])
    if row[WRONG_SPEED] > 0.0:
        for k in range(3):
            P[k, k] += squared(row[WRONG_SPEED] * WRONG_FOR_S)
            P[3 + k, 3 + k] += squared(row[WRONG_SPEED])


@compiled
def _rolling(s: Foot, row: Array, x: Array) -> Vector:
    """Velocity of the sensor, m/s, stage, of a foot that stands and rolls over the sole below its ball.

    Held to be zero instead, it takes 2 to 3 cm/s into every swing: the ankle rises at 0.1 m/s while the foot is quiet.
    (Real feet go 8 to 15 cm forward per radian then, by motion capture; the ball itself lies 7 cm below the ankle.)
    """
    R = rotation(quaternion(x, 6))
    rate = (row[ROLL] - x[13], row[ROLL + 1] - x[14], row[ROLL + 2] - x[15])
    v = turned(R, cross(rate, vector(s.sole_arm, 0)))
    return -v[0], -v[1], -v[2]


@compiled
def _level(up: Vector, variance: float, x: Array, P: Array) -> None:
    """``up``, sensor frame, is the stage's up: two components of the attitude error, never the yaw."""
    h = np.zeros(NE)
    seen = turned(rotation(quaternion(x, 6)), up)
    h[6] = 1.0
    update1(x, P, h, -seen[2], variance, np.inf)
    seen = turned(rotation(quaternion(x, 6)), up)
    h[6], h[8] = 0.0, 1.0
    update1(x, P, h, seen[0], variance, np.inf)


@compiled
def _reset(row: Array, x: Array, P: Array) -> None:
    """A new start of place, speed and yaw, or of the whole attitude; biases, and else the tilt, stay."""
    if row[TURN_SIGMA] == WHOLE:
        for k in range(4):
            x[6 + k] = row[MEASURED_Q + k]
        for k in (6, 8):
            for j in range(NE):
                P[k, j] = 0.0
                P[j, k] = 0.0
    elif row[TURN_SIGMA] > 0.0:
        # The twist about up of the turn from the state's attitude to the measured one.
        a, b = quaternion(row, MEASURED_Q), quaternion(x, 6)
        y = -a[3] * b[1] + a[0] * b[2] + a[1] * b[3] - a[2] * b[0]
        w = a[3] * b[3] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        turn_stage(x[6:10], 0.0, 2.0 * math.atan2(y, w), 0.0)
    r = turned(rotation(quaternion(x, 6)), vector(row, ARM))
    for k in range(3):
        x[k] = row[POINT + k] - r[k]
        x[3 + k] = row[SPEED + k]
    for k in range(6):
        for j in range(NE):
            P[k, j] = 0.0
            P[j, k] = 0.0
        P[k, k] = squared(row[POINT_SIGMA]) if k < 3 else squared(row[SPEED_SIGMA])
    if row[YAW_SIGMA] > 0.0:
        for j in range(NE):
            P[7, j] = 0.0
            P[j, 7] = 0.0
        P[7, 7] = squared(row[YAW_SIGMA])
    P[6, 6] += squared(row[TILT_SIGMA])
    P[8, 8] += squared(row[TILT_SIGMA])
