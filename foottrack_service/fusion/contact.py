"""When an inertial foot stands: adaptive zero-velocity detection.

The statistic is that of SHOE (Skog et al., Zero-velocity detection, IEEE TBME 2010): the spread of the specific
force, the rotation rate and the distance of the mean force from gravity, over 80 ms, each over what a quiet stance
shows. A fixed threshold that suits walking misses the stances of a run and loses metres; here a stance is what is ten
times quieter than the swing before it, and the less quiet it is the less its zero velocity counts. One setting serves
standing, walking, soft soles and running.
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_service.fusion.compiled import compiled
from foottrack_service.fusion.foot_filter_events import ACC, GYRO, IMU, KIND, MEAN_RATE
from foottrack_service.fusion.foot_filter_kernel import GRAVITY
from foottrack_service.rotations import Array

WINDOW_NS = 80_000_000
LEAST_SAMPLES = 4
FORCE_SPREAD = 0.3
"""m/s^2; also for the mean force."""
RATE = 0.3
"""rad/s."""
QUIET = 1.2
"""The statistic of a clear stance."""
SHARE_OF_SWING = 0.1
"""A stance is this much quieter than the swing before it."""
SWING_MEMORY_S = 2.0
STILL_SIGMA = 0.005
"""m/s: how still a foot stands at best. Holds per 10 ms: neighbouring samples repeat the same truth."""
SIGMA_GROWTH = 0.02
"""m/s per unit of the statistic."""

# memory, shape (2,): the swing's peak that fades, and the statistic of the newest sample
PEAK, STATISTIC = 0, 1


@compiled
def stillness(t: Array, rows: Array, i: int) -> float:
    """The statistic over the window that ends at the IMU row i (0: as still as can be); inf before there is one.

    Rates that are differences of a device's own attitude carry its corrections: they are averaged over half a window.
    """
    n = 0
    mean, halves = np.zeros(3), np.zeros((2, 3))
    counts = np.zeros(2)
    square, rate = 0.0, 0.0
    j = i
    while j >= 0 and t[i] - t[j] <= WINDOW_NS:
        if rows[j, KIND] == IMU:
            half = 0 if t[i] - t[j] < WINDOW_NS // 2 else 1
            for k in range(3):
                a, w = rows[j, ACC + k], rows[j, GYRO + k]
                mean[k] += a
                square += a * a
                halves[half, k] += w
                rate += w * w
            counts[half] += 1.0
            n += 1
        j -= 1
    if j < 0 or n < LEAST_SAMPLES:
        return math.inf
    norm2 = (mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]) / (n * n)
    spread2 = max(0.0, square / n - norm2)
    off = math.sqrt(norm2) - GRAVITY
    if rows[i, MEAN_RATE] == 1.0:
        rate = 0.0
        for half in range(2):
            if counts[half] > 0.0:
                for k in range(3):
                    rate += halves[half, k] ** 2 / counts[half]
    return math.sqrt((spread2 + off * off) / FORCE_SPREAD**2 + rate / n / RATE**2)


@compiled
def stance_sigma(t: Array, rows: Array, i: int, dt: float, memory: Array) -> float:
    """How well the foot's velocity is known to be zero at the IMU row i, m/s per 10 ms; 0.0 when it swings.

    ``dt``, s, since the last sample; ``memory``, shape (2,), is carried from sample to sample.
    """
    statistic = stillness(t, rows, i)
    memory[STATISTIC] = statistic
    if not math.isfinite(statistic):
        return 0.0
    memory[PEAK] = max(memory[PEAK] * math.exp(-dt / SWING_MEMORY_S), statistic)
    if statistic < max(QUIET, SHARE_OF_SWING * memory[PEAK]):
        return STILL_SIGMA + SIGMA_GROWTH * statistic
    return 0.0
