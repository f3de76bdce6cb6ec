"""IMU samples as rows of the timeline, and the attitude that a filter begins with."""

from __future__ import annotations

import math

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import conjugate, logarithm, product, quaternion, rotation, squared
from foottrack_service.fusion.contact import SEEN_SPAN_NS, rest, stance_sigma
from foottrack_service.fusion.foot_filter_events import (
    ACC,
    CLIPPED,
    COLUMNS,
    FLOOR,
    GYRO,
    IMU,
    KIND,
    MEAN_RATE,
    UP,
    WANDER,
    WRONG_SPEED,
    ZERO_SIGMA,
)
from foottrack_service.fusion.foot_filter_kernel import ACC_BIAS, GRAVITY, NE, NX
from foottrack_service.fusion.foot_filter_memory import Feet, Foot
from foottrack_service.fusion.foot_filter_output import follow
from foottrack_service.fusion.foot_filter_replay import HOLE_S, replay
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.fusion.timeline import place
from foottrack_service.rotations import Array

LEFT_OUT, TAKEN, FIRST, JUMPED = 0, 1, 2, 3
"""What became of a sample."""
JUMPED_AFTER = 4
"""So many samples in a row from the past: the device's clock was set back."""
UNSURE_AFTER_S = 0.25
"""A hole in the IMU after which the place needs fixes that agree."""
MOST_RATE = 40.0
"""rad/s: increments of a device's q that are faster are its own corrections, not the foot."""
FULL_SCALES = (39.2266, 78.4532, 156.9064)
"""m/s^2 at which accelerometers end: 4, 8, 16 g. Not this one, where it has ever given more."""
STUCK_ABOVE = 11.0
"""m/s^2: an axis that gives the same bits beyond this three times is at its end, wherever that is: no smaller than
anything it has ever given. (Coarse or smooth samples repeat by chance, some every second, and each would cost the
velocity 0.14 m/s of its certainty.)"""
STRONGEST_S = 600.0
"""How fast the strongest ever is forgotten: one damaged sample must not hide an accelerometer's end for good."""
TAG_MEMORY_NS = 250_000_000
"""Whose tag was seen so lately does not ask the floor: it has been weighed against the camera (foot_filter_range). Both
asked in turn, each as if it erred anew every time, they tilt the foot by what lies between them.
"""
LEAST_FORCE = 1.0
"""m/s^2: a sensor in free fall does not know where up is."""
DEVICE_TILT = 0.03
"""rad/sqrt(s) by which the tilt of a device's own q wanders while it moves: 1.7 deg that change within 2 s."""
FULL_EFFORT = 3.0
"""m/s^2 beyond gravity at which all of that is there."""
EFFORT_MEMORY_S = 2.0
"""A device that was moved levels itself again afterwards: its tilt goes on wandering in the stance."""
_UP = np.array([0.0, 1.0, 0.0])


@compiled
def take_sample(foot: Feet, t: int, has_gyro: bool, has_q: bool) -> int:
    """Take the sample of ``t``, ns, that lies in ``acc``, ``gyro`` and ``q``.

    LEFT_OUT: without rate or attitude, or not finite, or from the past. JUMPED: nor is it taken, but so many came from
    the past that the device's clock was set back. FIRST: it begins the timeline, without a state yet.
    """
    s = foot[0]
    if not _usable(s, has_gyro, has_q):
        return LEFT_OUT
    if s.n > 0 and t <= s.newest:
        s.behind += 1
        return LEFT_OUT if s.behind < JUMPED_AFTER else JUMPED
    if s.n == 0 and not has_q and squared(s.acc[0]) + squared(s.acc[1]) + squared(s.acc[2]) < LEAST_FORCE**2:
        return LEFT_OUT
    s.behind = 0
    first = s.n == 0
    dt = 0.0 if first else (t - s.newest) * 1e-9
    if dt > UNSURE_AFTER_S:
        s.acquired = 0
    i = place(s, t)
    if i == 0 and not first:
        return LEFT_OUT
    row = s.rows[i]
    _fill_sample(s, row, has_gyro, has_q, dt)
    s.newest = t
    if s.seen > 0 and t - s.seen_t[s.seen - 1] > SEEN_SPAN_NS:
        # What a foot did when it was last seen says nothing of its next stances in the dark.
        s.seen, s.seen_speed = 0, 0.0
    if not first:
        sigma = stance_sigma(s.t[:], s.rows[:], i, dt, s.X[i - 1], s.P[i - 1], s.stance[:])
        if sigma > 0.0:
            row[ZERO_SIGMA] = math.sqrt(sigma * sigma + s.seen_speed * s.seen_speed)
        if s.seen_speed > 0.0:
            row[WRONG_SPEED] = 0.0
        rest(s, row, s.P[i - 1], dt if sigma > 0.0 and s.seen_speed == 0.0 else 0.0)
        row[FLOOR] = math.nan if abs(t - s.tag_t) < TAG_MEMORY_NS else s.floor
        replay(s, i, s.n)
    for k in range(COLUMNS):
        s.last[k] = row[k]
    if first:
        return FIRST
    follow(s, min(dt, HOLE_S))
    return TAKEN


def upright(sample: ImuSample) -> Array:
    """Sensor to a frame with +Y up: the device's own attitude, else what the specific force says."""
    if sample.q is not None:
        return rot.normalised(sample.q)
    norm = float(np.linalg.norm(sample.acc))
    axis = np.cross(sample.acc / norm, _UP)
    sine = float(np.linalg.norm(axis))
    angle = math.atan2(sine, float(sample.acc[1]) / norm)
    return rot.from_rotation_vector(axis / sine * angle if sine > 1e-9 else np.array([angle, 0.0, 0.0]))


def first_state(q: Array, p: Array, sample: ImuSample) -> tuple[Array, Array]:
    """State (17,) and covariance (16, 16) of a foot that stands with its sensor at ``p``, m, and attitude ``q``."""
    x, P = np.zeros(NX), np.zeros((NE, NE))
    x[0:3], x[6:10] = p, q
    tilt, bias = (0.03, 1e-7) if sample.gyro is None else (0.05, 0.01)
    sigmas = [0.03] * 3 + [0.1] * 3 + [tilt, 0.02, tilt] + [ACC_BIAS] * 3 + [bias] * 3 + [0.005]
    P[np.arange(NE), np.arange(NE)] = np.square(sigmas)
    return x, P


@compiled
def _usable(s: Foot, has_gyro: bool, has_q: bool) -> bool:
    """Whether all numbers are finite and there is a rate or an attitude."""
    # A sum of squares is finite only where all its parts are.
    total, size = 0.0, 0.0
    for k in range(3):
        total += s.acc[k] * s.acc[k]
        if has_gyro:
            total += s.gyro[k] * s.gyro[k]
    for k in range(4):
        size += s.q[k] * s.q[k]
    if has_q:
        return math.isfinite(total + size) and size > 0.0
    return has_gyro and math.isfinite(total)


@compiled
def _fill_sample(s: Foot, row: Array, has_gyro: bool, has_q: bool, dt: float) -> None:
    """Write the sample, which comes ``dt`` s after the last one, into ``row``."""
    row[KIND] = IMU
    largest, stuck = 0.0, False
    s.strongest *= math.exp(-max(dt, 0.0) / STRONGEST_S)
    for k in range(3):
        force = s.acc[k]
        row[ACC + k] = force
        largest = max(largest, abs(force))
        s.strongest = max(s.strongest, abs(force))
        repeats = force == s.forces[0, k] and force == s.forces[1, k]
        stuck |= repeats and abs(force) > STUCK_ABOVE and abs(force) == s.strongest
        s.forces[1, k] = s.forces[0, k]
        s.forces[0, k] = force
    for scale in FULL_SCALES:
        stuck |= largest / scale > 0.985 and s.strongest < 1.02 * scale
    row[CLIPPED] = 1.0 if stuck else 0.0
    q = (0.0, 0.0, 0.0, 0.0)
    if has_q:
        n = math.sqrt(squared(s.q[0]) + squared(s.q[1]) + squared(s.q[2]) + squared(s.q[3]))
        q = (s.q[0] / n, s.q[1] / n, s.q[2] / n, s.q[3] / n)
        row[UP], row[UP + 1], row[UP + 2] = rotation(q)[1]
    if has_gyro:
        row[GYRO], row[GYRO + 1], row[GYRO + 2] = s.gyro[0], s.gyro[1], s.gyro[2]
    else:
        row[MEAN_RATE] = 1.0
        felt2 = 0.0
        for k in range(3):
            felt2 += squared(row[ACC + k] - GRAVITY * row[UP + k])
        effort = min(1.0, math.sqrt(felt2) / FULL_EFFORT)
        s.effort = max(s.effort * math.exp(-dt / EFFORT_MEMORY_S), effort)
        row[WANDER] = DEVICE_TILT * s.effort
        last = quaternion(s.last_q, 0)
        if last != (0.0, 0.0, 0.0, 0.0) and dt > 0.0:
            turn = logarithm(product(conjugate(last), q))
            if squared(turn[0]) + squared(turn[1]) + squared(turn[2]) < squared(MOST_RATE * dt):
                row[GYRO], row[GYRO + 1], row[GYRO + 2] = turn[0] / dt, turn[1] / dt, turn[2] / dt
    s.last_q[0], s.last_q[1], s.last_q[2], s.last_q[3] = q
