"""What leaves the filter: the ankle predicted to a stamp, and the stance lock, compiled.

A standing foot is held by its *ball*, since the heel rises first (held by the toes' tip, which goes down meanwhile, the
ankle was 2 cm too high); when it leaves, what the lock had held back fades within 50 ms. Nothing is averaged: an
average of 0.2 costs 9 mm and 39 ms on a walk (simulated).
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import (
    cross,
    product,
    quaternion,
    rotation,
    squared,
    turn_body,
    turned,
    vector,
)
from foottrack_service.fusion.foot_filter_events import ACC, CLIPPED, GYRO, ZERO_SIGMA
from foottrack_service.fusion.foot_filter_kernel import GRAVITY
from foottrack_service.fusion.foot_filter_memory import Feet, Foot
from foottrack_service.fusion.foot_filter_replay import HOLE_S
from foottrack_service.rotations import Array

LONGEST_PREDICTION_S = 1.0
LONGEST_HOLD_S = 0.02
"""The last sample's acceleration and turning hold for so long; after that the foot coasts at its speed."""
COASTING_DECAY_S = 0.15
"""A coasting foot slows down: it is more likely to land than to fly on."""
COASTING_ACCELERATION = 15.0
"""m/s^2 SD of a foot that nobody measures."""

# lock, shape (9,)
LOCKED, HELD, OFFSET, SINCE, CONTACT = 0, 1, 4, 7, 8
BALL_SPEED = 0.15
"""m/s: a ball that is slower and has not risen still stands when the heel leaves."""
BALL_RISE = 0.012
"""m."""
FASTEST_FOLLOW_S, SLOWEST_FOLLOW_S = 0.1, 1.0
"""How fast the lock follows the filter: landing is corrected soon, a foot that has stood for long hardly moves."""
NEAR_HOLD = 0.004
"""m: by so much corrections of a standing foot may be off and are followed slowly; the further off, the sooner: a foot
that was led astray stood 2 cm beside itself for a second after its filter was right again."""
LARGEST_HOLD = 0.02
"""m: who disagrees by more is not held."""
RELEASE_S = 0.017
"""Time constant of the release: 5 % are left after 50 ms."""


@compiled
def follow(s: Foot, dt: float) -> None:
    """Carry the stance lock over the newest sample, dt in s. ``lock[OFFSET]`` is what the output is moved by."""
    lock, row, x, ball_arm = s.lock[:], s.last[:], s.X[s.n - 1], vector(s.ball_arm, 0)
    R = rotation(quaternion(x, 6))
    arm = turned(R, ball_arm)
    speed = turned(R, cross((row[GYRO] - x[13], row[GYRO + 1] - x[14], row[GYRO + 2] - x[15]), ball_arm))
    ball = (x[0] + arm[0], x[1] + arm[1], x[2] + arm[2])
    s2 = 0.0
    gap2 = 0.0
    for k in range(3):
        s2 += squared(x[3 + k] + speed[k])
        gap2 += squared(ball[k] - lock[HELD + k])
    pivots = lock[LOCKED] == 1.0 and s2 < BALL_SPEED**2 and ball[1] - lock[HELD + 1] < BALL_RISE
    stands = row[ZERO_SIGMA] > 0.0 or pivots
    lock[CONTACT] = 1.0 if stands else 0.0
    if row[ZERO_SIGMA] == 0.0:
        # What rolls on towards its toes is in contact still, but the ball rises then.
        lock[LOCKED] = 1.0 if pivots else 0.0
        fade = math.exp(-dt / RELEASE_S)
        for k in range(3):
            lock[OFFSET + k] *= fade
        return
    if lock[LOCKED] == 0.0 or gap2 > LARGEST_HOLD**2:
        keep = 1.0 if gap2 <= LARGEST_HOLD**2 or lock[LOCKED] == 0.0 else 0.0
        for k in range(3):
            lock[HELD + k] = ball[k] + keep * lock[OFFSET + k]
        lock[LOCKED] = 1.0
        lock[SINCE] = 0.0
    lock[SINCE] += dt
    gap2 = 0.0
    for k in range(3):
        gap2 += squared(ball[k] - lock[HELD + k])
    slowest = SLOWEST_FOLLOW_S * min(1.0, NEAR_HOLD**2 / max(gap2, 1e-12))
    share = min(1.0, dt / max(min(lock[SINCE], slowest), FASTEST_FOLLOW_S))
    for k in range(3):
        lock[HELD + k] += share * (ball[k] - lock[HELD + k])
        lock[OFFSET + k] = lock[HELD + k] - ball[k]


@compiled
def predicted(foot: Feet, t: int) -> Array:
    """The foot at ``t``, ns.

    Shape (11,): ankle (3, m), the foot's attitude (4), ankle's velocity (3, m/s), SD of the ankle per axis (m).
    """
    s = foot[0]
    i = s.n - 1
    row, x, P, lock, arm = s.last[:], s.X[i], s.P[i], s.lock[:], vector(s.ankle_arm, 0)
    dt = max(min((t - s.t[i]) * 1e-9, LONGEST_PREDICTION_S), -HOLE_S)
    out = np.empty(11)
    q = x[6:10].copy()
    hold = min(max(dt, -LONGEST_HOLD_S), LONGEST_HOLD_S)
    clipped = row[CLIPPED] == 1.0
    w = (row[GYRO] - x[13], row[GYRO + 1] - x[14], row[GYRO + 2] - x[15])
    turn_body(q, 0.5 * hold * w[0], 0.5 * hold * w[1], 0.5 * hold * w[2])
    g = turned(rotation(quaternion(q, 0)), (row[ACC] - x[10], row[ACC + 1] - x[11], row[ACC + 2] - x[12]))
    a = (0.0, 0.0, 0.0) if clipped else (g[0], g[1] - GRAVITY, g[2])
    turn_body(q, 0.5 * hold * w[0], 0.5 * hold * w[1], 0.5 * hold * w[2])
    R = rotation(quaternion(q, 0))
    r = turned(R, arm)
    coast = dt - hold
    slow = math.exp(-max(coast, 0.0) / COASTING_DECAY_S)
    spin = turned(R, cross(w, arm))
    free = 0.5 * COASTING_ACCELERATION * coast * coast if coast > 0.0 else 0.0
    still = lock[CONTACT] == 1.0
    total = 3.0 * free * free * (0.01 if still else 1.0)
    lever = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    for k in range(3):
        v = x[3 + k] + a[k] * hold
        out[k] = x[k] + x[3 + k] * hold + 0.5 * a[k] * hold * hold + r[k] + lock[OFFSET + k]
        out[k] += v * (COASTING_DECAY_S * (1.0 - slow) if coast > 0.0 else coast)
        out[7 + k] = (v + spin[k]) * slow
        total += P[k, k] + 2.0 * dt * P[k, 3 + k] + dt * dt * P[3 + k, 3 + k] + lever * P[6 + k, 6 + k]
    foot_q = product(quaternion(q, 0), quaternion(s.foot_to_sensor, 0))
    for k in range(4):
        out[3 + k] = foot_q[k]
    out[10] = math.sqrt(max(total, 0.0) / 3.0)
    return out
