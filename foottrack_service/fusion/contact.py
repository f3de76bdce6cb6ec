"""When an inertial foot stands: adaptive zero-velocity detection.

The statistic is that of SHOE (Skog et al., Zero-velocity detection, IEEE TBME 2010): the spread of the specific
force, the rotation rate and the distance of the mean force from gravity, over 80 ms, each over what a quiet stance
shows. A fixed threshold that suits walking misses the stances of a run and loses metres; here a stance is what is ten
times quieter than the swing before it, and the less quiet it is the less its zero velocity counts. One setting serves
standing, walking, soft soles and running.
"""

from __future__ import annotations

import math

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import Vector, quaternion, rotation, squared, turned
from foottrack_service.fusion.foot_filter_events import (
    ACC,
    GYRO,
    IMU,
    KIND,
    MEAN_RATE,
    REST_RATE,
    REST_S,
    ROLL,
    WRONG_SPEED,
    WRONG_TILT,
    Stamps,
)
from foottrack_service.fusion.foot_filter_kernel import GRAVITY, ZERO_GATE, speed_distance
from foottrack_service.fusion.foot_filter_memory import SEEN_KEPT, Foot
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
SIGMA_GROWTH = 0.03
"""m/s per unit of the statistic."""
LEVER = 0.075
"""m: so far from the ball may the point be over which a foot rolls that turns while it stands."""

PUSH, PUSH_SHARE = 0.5, 0.3
"""m/s^2, and per unit of the statistic: who is pushed by more, beyond what the tilt is unsure by, does not stand."""
DOUBT_S = 1.0
"""A push that lasts for longer, in silence, is no push but a wrong tilt."""
HIDDEN_DOUBT_S = 0.1
"""So is one that would have to show in |f| (a push sideways makes it longer by its square over 2 g), and does not."""

CALM_SIGMA, CALM_GATE = 0.04, 12.0
"""m/s; who is not quiet by itself, but only beside a swing full of impacts, may be in the middle of the next one: so a
speed beyond this chi-square is believed rather. In real recordings of walks and runs no stance is further off."""
CALM_S = 0.25
"""No middle of a swing is calm for longer: then it is the speed that is wrong."""
GLIDE, STEADY_S = 1.0, 0.25
"""m, and s where it is as quiet as QUIET_STATISTIC: no foot and no hand glides further at a speed that never changes,
or for longer without any tremor: then it is the speed that is wrong."""

QUIET_STATISTIC = 0.25
"""A foot this quiet may show its gyro's bias ..."""
REST_BLOCK_S, FIRST_BLOCK_S = 0.5, 0.1
"""... by its mean over so long, once it has been as quiet for as long again: weight is shifted half a second before a
step is seen, and turns the foot by degrees. Who does not know the bias yet takes what each stance offers."""
BIAS_KNOWN = 0.0005
"""rad/s per axis."""

SEEN_SPAN_NS = 250_000_000
SEEN_LEAST = 6
SEEN_NOISE = 0.04
"""m/s: fixes of a standing foot may drift apart by so much through errors of the camera's mount."""

# memory, shape (6,): the swing's peak that fades, the newest sample's statistic, how long it was pushed, for how many
# seconds in all it did not stand, how long it seemed to stand at a speed that it cannot have then, and which share
# of what a foot may glide it has glided, by what the filter believes
PEAK, STATISTIC, DOUBTED, UNREST, TOO_FAST, GLIDED = 0, 1, 2, 3, 4, 5

# rest, shape (8,): for how long the foot has rested, s, and its turn meanwhile, rad; the same of the block before that,
# but as a mean rate, rad/s
NOW, BEFORE = 0, 4


@compiled
def stillness(t: Stamps, rows: Array, i: int, bias: Vector = (0.0, 0.0, 0.0)) -> tuple[float, Vector, Vector]:
    """The statistic over the window that ends at the IMU row i (0: as still as can be); inf before there is one.

    And the mean specific force, m/s^2, and the mean rate over its later half, rad/s. ``bias``, m/s^2: what the
    accelerometer is known to be off by.
    Rates that are differences of a device's own attitude carry its corrections: they are averaged over half a window.
    """
    f0 = f1 = f2 = square = 0.0
    late0 = late1 = late2 = early0 = early1 = early2 = rate = 0.0
    n, late = 0, 0
    j = i
    while j >= 0 and t[i] - t[j] <= WINDOW_NS:
        if rows[j, KIND] == IMU:
            a0, a1, a2 = rows[j, ACC], rows[j, ACC + 1], rows[j, ACC + 2]
            w0, w1, w2 = rows[j, GYRO], rows[j, GYRO + 1], rows[j, GYRO + 2]
            f0, f1, f2 = f0 + a0, f1 + a1, f2 + a2
            square += a0 * a0 + a1 * a1 + a2 * a2
            rate += w0 * w0 + w1 * w1 + w2 * w2
            if t[i] - t[j] < WINDOW_NS // 2:
                late0, late1, late2 = late0 + w0, late1 + w1, late2 + w2
                late += 1
            else:
                early0, early1, early2 = early0 + w0, early1 + w1, early2 + w2
            n += 1
        j -= 1
    if j < 0 or n < LEAST_SAMPLES:
        return math.inf, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    f0, f1, f2 = f0 / n, f1 / n, f2 / n
    norm2 = f0 * f0 + f1 * f1 + f2 * f2
    spread2 = max(0.0, square / n - norm2)
    off = math.sqrt(squared(f0 - bias[0]) + squared(f1 - bias[1]) + squared(f2 - bias[2])) - GRAVITY
    if rows[i, MEAN_RATE] == 1.0:
        rate = (late0 * late0 + late1 * late1 + late2 * late2) / late
        if n > late:
            rate += (early0 * early0 + early1 * early1 + early2 * early2) / (n - late)
    statistic = math.sqrt((spread2 + off * off) / FORCE_SPREAD**2 + rate / n / RATE**2)
    return statistic, (f0, f1, f2), (late0 / late, late1 / late, late2 / late)


@compiled
def stance_sigma(t: Stamps, rows: Array, i: int, dt: float, x: Array, P: Array, memory: Array) -> float:
    """How well the velocity of the foot's ball is known to be zero at the IMU row i, m/s per 10 ms; 0.0 when it swings.

    Writes into the row how the foot turns meanwhile: over its ball, from long before the heel is seen to rise.

    ``dt``, s, since the last sample; ``x`` and ``P`` the filter before it; ``memory``, shape (6,), is carried from
    sample to sample.
    """
    statistic, mean, rate = stillness(t, rows, i, (x[10], x[11], x[12]))
    memory[STATISTIC] = statistic
    memory[UNREST] += dt
    if not math.isfinite(statistic):
        return 0.0
    memory[PEAK] = max(memory[PEAK] * math.exp(-dt / SWING_MEMORY_S), statistic)
    if statistic >= max(QUIET, SHARE_OF_SWING * memory[PEAK]):
        memory[DOUBTED] = memory[GLIDED] = 0.0
        return 0.0
    # A smooth push sideways hardly changes |f|, but it shows against what the filter knows to be up.
    a = turned(rotation(quaternion(x, 6)), (mean[0] - x[10], mean[1] - x[11], mean[2] - x[12]))
    tilt = math.sqrt(P[6, 6] + P[8, 8])
    pushed = math.sqrt(a[0] * a[0] + squared(a[1] - GRAVITY) + a[2] * a[2])
    if pushed > PUSH + PUSH_SHARE * statistic + 3.0 * GRAVITY * tilt:
        memory[DOUBTED] += dt
        hidden = statistic < QUIET_STATISTIC and pushed * pushed > 4.0 * GRAVITY * FORCE_SPREAD * statistic
        if memory[DOUBTED] < (HIDDEN_DOUBT_S if hidden else DOUBT_S):
            return 0.0
        if hidden:
            rows[i, WRONG_TILT] = pushed / GRAVITY
            memory[DOUBTED] = 0.0
    sigma = STILL_SIGMA + SIGMA_GROWTH * statistic
    # A device's corrections of its own tilt look like rolling: believed, they cost more than rolling does.
    rolls = rows[i, MEAN_RATE] != 1.0
    if rolls:
        turning = math.sqrt(squared(rate[0] - x[13]) + squared(rate[1] - x[14]) + squared(rate[2] - x[15]))
        sigma += LEVER * turning
    if sigma > CALM_SIGMA and speed_distance(x, P, (0.0, 0.0, 0.0), sigma * sigma) > CALM_GATE:
        memory[TOO_FAST] += dt
        if memory[TOO_FAST] < CALM_S:
            return 0.0
    else:
        memory[TOO_FAST] = 0.0
    speed2 = x[3] * x[3] + x[4] * x[4] + x[5] * x[5]
    variance = sigma * sigma * 0.01 / max(dt, 1e-3)
    if speed2 > ZERO_GATE * variance and speed_distance(x, P, (0.0, 0.0, 0.0), variance) > ZERO_GATE:
        memory[GLIDED] += dt * max(math.sqrt(speed2) / GLIDE, 1.0 / STEADY_S if statistic < QUIET_STATISTIC else 0.0)
        if memory[GLIDED] > 1.0:
            rows[i, WRONG_SPEED] = math.sqrt(speed2)
            memory[GLIDED] = 0.0
    else:
        memory[GLIDED] = 0.0
    memory[UNREST] -= dt
    if rolls:
        rows[i, ROLL], rows[i, ROLL + 1], rows[i, ROLL + 2] = rate
    return sigma


@compiled
def rest(s: Foot, row: Array, P: Array, dt: float) -> None:
    """Write into the newest ``row`` how a resting foot turned one block ago, whenever a block of rest is full.

    ``P``, shape (16, 16), is the filter's before it; ``dt``, s, since the last sample, or 0 for a foot that swings, or
    that fixes see moving: its rest begins anew.
    """
    memory = s.rest[:]
    if not 0.0 < dt < REST_BLOCK_S or s.stance[STATISTIC] >= QUIET_STATISTIC or row[MEAN_RATE] == 1.0:
        memory[:] = 0.0
        return
    memory[NOW] += dt
    for k in range(3):
        memory[NOW + 1 + k] += row[GYRO + k] * dt
    known = max(P[12, 12], P[13, 13], P[14, 14]) < BIAS_KNOWN**2
    if memory[NOW] < (REST_BLOCK_S if known else FIRST_BLOCK_S):
        return
    row[REST_S] = memory[BEFORE]
    for k in range(3):
        row[REST_RATE + k] = memory[BEFORE + 1 + k]
        memory[BEFORE + 1 + k] = memory[NOW + 1 + k] / memory[NOW]
        memory[NOW + 1 + k] = 0.0
    memory[BEFORE] = memory[NOW]
    memory[NOW] = 0.0


@compiled
def see(s: Foot, t: int, point: Vector) -> None:
    """An accepted fix at ``t``, ns, m, stage: do those of the last quarter of a second move?

    Then the foot does not stand, however quiet it is: slow knee bends and a tracker in a hand are quiet, and no stance.
    ``seen_speed`` is 0 while they show none.
    """
    first = 1 if s.seen == SEEN_KEPT else 0
    while first < s.seen and t - s.seen_t[first] > SEEN_SPAN_NS:
        first += 1
    n = s.seen - first
    for i in range(n):
        s.seen_t[i] = s.seen_t[i + first]
        for k in range(3):
            s.seen_p[i, k] = s.seen_p[i + first, k]
    s.seen_t[n] = t
    for k in range(3):
        s.seen_p[n, k] = point[k]
    n += 1
    s.seen = n
    s.seen_speed = 0.0
    if n < SEEN_LEAST or t - s.seen_t[0] <= SEEN_SPAN_NS // 2:
        return
    middle = 0.0
    for i in range(n):
        middle += (s.seen_t[i] - t) * 1e-9 / n
    spread = along0 = along1 = along2 = 0.0
    for i in range(n):
        since = (s.seen_t[i] - t) * 1e-9 - middle
        spread += since * since
        along0 += since * s.seen_p[i, 0]
        along1 += since * s.seen_p[i, 1]
        along2 += since * s.seen_p[i, 2]
    speed = math.sqrt(along0 * along0 + along1 * along1 + along2 * along2) / spread
    if speed > SEEN_NOISE:
        s.seen_speed = speed
