"""What a fix is worth before it is fused: plausibility, the tag's two attitudes, the distance from what we expect."""

from __future__ import annotations

import math

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.compiled import compiled
from foottrack_service.config import FootSettings
from foottrack_service.fusion.compiled_rotations import Vector, product, quaternion, rotation, squared, turned, vector
from foottrack_service.fusion.contact import see
from foottrack_service.fusion.foot_filter_doubt import NOT_OURS
from foottrack_service.fusion.foot_filter_events import (
    ACCEPTED,
    ARM,
    FACE,
    FIX,
    GYRO,
    IMU,
    KIND,
    MEASURED_Q,
    PLACED_DELAY,
    PLACES,
    POINT,
    POINT_COV,
    TEACHES,
    TURN_SIGMA,
    WRONG_SPEED,
    ZERO_SIGMA,
)
from foottrack_service.fusion.foot_filter_kernel import LONGEST_DELAY_S, NE, invert3, seen_through
from foottrack_service.fusion.foot_filter_memory import DEPTH, MARKER, Feet, Foot
from foottrack_service.fusion.foot_filter_models import attitude_error, point_model, turn_off
from foottrack_service.fusion.foot_filter_range import SCALE, learn_range
from foottrack_service.fusion.foot_filter_replay import replay
from foottrack_service.fusion.interface import FIX_MEMORY_S, OpticalFix, Verdict
from foottrack_service.fusion.timeline import place
from foottrack_service.rotations import Array

UNUSED, STALE, TAKEN, FAR, DOUBTED, IMPOSSIBLE = 0, 1, 2, 3, 4, 5
"""What became of a fix."""
UNSURE_SIGMA = 0.3
"""m per axis: who knows the place no better needs fixes that agree."""
CHI_SQUARE_3 = 16.3
"""99.9 % of good fixes are below (3 degrees of freedom)."""
CHI_SQUARE_1 = 16.3
SIZE_RATIO = (0.8, 1.25)
LEAST_EDGE_PX = 2.0
OLDEST_S = 0.8
HEAD_NOISE = 0.0015
"""m per axis: what the head pose adds to the picture's own noise."""
HEAD_TURN_NOISE = 0.0007
"""rad: likewise, times the distance."""
LEAST_TURN_SIGMA = 0.012
"""rad: a printed tag is not glued on straighter."""
TURN_PER_METRE = 25.0
"""rad/m: a tag's turn in the picture is known to its corner noise over its size (6 cm)."""
TILT_USABLE = 0.45
"""rad, and three sigma of our tilt: a tag's attitude that leans more against gravity is not used."""
TILT_IMPOSSIBLE = 0.9
"""rad, likewise: and beyond this it is not our tag, wherever it is."""
TILT_KNOWN = 0.6
"""rad, three sigma: who knows its tilt no better cannot tell a tag's attitude from its mirror image."""
BLOB_SIGMA = 0.025
"""m per axis: shoes and views differ."""
BLOB_WANDER = 0.025
"""m per axis: as other parts of the shoe come into view; the same for many pictures, so it counts more than its 1 cm:
blobs pulled a foot that had swung for half a second off by 2 cm."""
BLOB_CORRELATED = 20.0
"""Pictures after which a blob says something new."""


def implausible(fix: OpticalFix) -> Verdict | None:
    """Why a fix is not looked at any further; None when it may be good."""
    # A sum is finite only where all its parts are.
    xx, yx, zx, xy, yy, zy, xz, yz, zz = fix.cov.ravel().tolist()
    total = sum(fix.p.tolist()) + sum(fix.head.p.tolist()) + sum(fix.head.q.tolist())
    total += xx + yx + zx + xy + yy + zy + xz + yz + zz
    if not math.isfinite(total) or min(xx, yy, zz) < 0.0:
        return Verdict.INVALID
    if fix.edge_px < LEAST_EDGE_PX:
        return Verdict.BORDER
    if fix.size_ratio is not None and not SIZE_RATIO[0] <= fix.size_ratio <= SIZE_RATIO[1]:
        return Verdict.SIZE
    return None


class Blob:
    """Where on the foot the depth camera's blob has its middle: halfway to the toes until both were seen together."""

    def __init__(self, foot: FootSettings) -> None:
        self.point: Array = 0.5 * np.array(foot.toe.p)
        """Foot frame, m."""
        self._n = 0

    @property
    def sigma(self) -> float:
        """m per axis."""
        return math.hypot(BLOB_SIGMA / math.sqrt(1.0 + self._n / BLOB_CORRELATED), BLOB_WANDER)

    def learn(self, ankle: Array, foot_q: Array, seen: Array) -> None:
        """A blob was seen at ``seen`` while the foot's pose was known by its tag."""
        offset = rot.unrotate(foot_q, seen - ankle) - self.point
        if float(offset @ offset) < (3.0 * BLOB_SIGMA) ** 2:
            self._n = min(self._n + 1, 600)
            self.point = self.point + offset / (BLOB_CORRELATED + self._n)


@compiled
def take_fix(foot: Feet, t: int, kind: int, has_q: bool, has_alt: bool, strange: bool) -> int:
    """Take the fix of ``t``, ns, that lies in ``p``, ``q``, ``q_alt``, ``cov``, ``head_p`` and ``head_q``.

    It is the event ``fix_at`` then, off by ``residual``, and waits for ``settle_fix`` where it is not TAKEN.
    ``strange``: its stamp may be wrong.
    FAR: good, but so far off that it may be the other foot's. DOUBTED: beyond the gates, or of a foot that does not
    know its place. IMPOSSIBLE: no attitude of the tag can be this foot's.
    """
    s = foot[0]
    if s.n == 0 or t > s.newest + FIX_MEMORY_S * 1e9:
        return UNUSED
    if t < s.newest - OLDEST_S * 1e9:
        return STALE
    delay = min(max(s.X[s.n - 1, 16], -LONGEST_DELAY_S), LONGEST_DELAY_S)
    t += round(delay * 1e9)
    i = place(s, t)
    if i == 0:
        return STALE
    row, x, P = s.rows[i], s.X[i], s.P[i]
    _fill_fix(s, row, kind, delay)
    replay(s, i, i + 1)
    ours = _take_attitude(s, row, x, P, has_q, has_alt)
    place_off, turn_off, residual = _judged(row, x, P, _rate(s, i, x))
    if not (P[0, 0] <= UNSURE_SIGMA**2 and P[1, 1] <= UNSURE_SIGMA**2 and P[2, 2] <= UNSURE_SIGMA**2):
        s.acquired = 0
    s.fix_at = i
    s.residual[0], s.residual[1], s.residual[2] = residual
    if not ours:
        return IMPOSSIBLE
    if s.acquired == 0 or not (place_off <= CHI_SQUARE_3 and turn_off <= CHI_SQUARE_1):
        return DOUBTED
    if squared(residual[0]) + squared(residual[1]) + squared(residual[2]) > NOT_OURS**2:
        return FAR
    _accept(s, i, strange)
    if kind == MARKER and not strange:
        s.tag_t = t
        if s.seen_speed == 0.0 and s.last[ZERO_SIGMA] > 0.0:
            learn_range(s, x)
    replay(s, i, s.n)
    return TAKEN


@compiled
def settle_fix(foot: Feet, i: int, accepted: bool, strange: bool) -> None:
    """The fix at event i is accepted or not; all events from there on are replayed."""
    s = foot[0]
    if accepted:
        _accept(s, i, strange)
    replay(s, i, s.n)


@compiled
def _accept(s: Foot, i: int, strange: bool) -> None:
    s.rows[i, ACCEPTED] = PLACES if strange else TEACHES
    see(s, s.t[i], vector(s.rows[i], POINT))
    if s.seen_speed > 0.0:
        for j in range(i + 1, s.n):
            if s.rows[j, ZERO_SIGMA] > 0.0:
                s.rows[j, ZERO_SIGMA] = max(s.rows[j, ZERO_SIGMA], s.seen_speed)
                s.rows[j, WRONG_SPEED] = 0.0


@compiled
def _fill_fix(s: Foot, row: Array, kind: int, delay: float) -> None:
    """Place and noise, in the stage."""
    row[KIND] = FIX
    R, shorter = rotation(quaternion(s.head_q, 0)), 1.0 / (1.0 + s.range[SCALE])
    p = (shorter * s.p[0], shorter * s.p[1], shorter * s.p[2])
    cov = (vector(s.cov[0], 0), vector(s.cov[1], 0), vector(s.cov[2], 0))
    seen = turned(R, p)
    noise = HEAD_NOISE**2 + HEAD_TURN_NOISE**2 * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    if kind == DEPTH:
        noise += squared(s.blob_sigma)
    for k in range(3):
        row[POINT + k] = s.head_p[k] + seen[k]
        row[ARM + k] = s.blob_arm[k] if kind == DEPTH else s.marker_arm[k]
    for j in range(3):
        # A column of cov R', turned: the column j of R cov R'.
        column = turned(R, turned(cov, R[j]))
        for k in range(3):
            row[POINT_COV + 3 * k + j] = column[k] + (noise if j == k else 0.0)
    row[PLACED_DELAY] = delay


@compiled
def _take_attitude(s: Foot, row: Array, x: Array, P: Array, has_q: bool, has_alt: bool) -> bool:
    """Let gravity, as the state ``x`` knows it, choose among the tag's attitudes.

    False: none of them can be this foot's. One that leans a little too much is just not used.
    """
    to_marker = quaternion(s.sensor_to_marker, 0)
    best, least = (0.0, 0.0, 0.0, 1.0), math.inf
    for second in (False, True):
        q = quaternion(s.q_alt, 0) if second else quaternion(s.q, 0)
        n = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        if (has_alt if second else has_q) and 0.0 < n < math.inf:
            seen = product(quaternion(s.head_q, 0), (q[0] / n, q[1] / n, q[2] / n, q[3] / n))
            error = attitude_error(product(seen, to_marker), x)
            lean = math.sqrt(error[0] * error[0] + error[2] * error[2])
            if lean < least:
                best, least = seen, lean
    if least == math.inf:
        return True
    unsure = 3.0 * math.sqrt(P[6, 6] + P[8, 8])
    if least > TILT_IMPOSSIBLE + unsure:
        return False
    q = product(best, to_marker)
    face = rotation(to_marker)[2]
    for k in range(4):
        row[MEASURED_Q + k] = q[k]
    for k in range(3):
        row[FACE + k] = face[k]
    across2 = TURN_PER_METRE * TURN_PER_METRE * max(0.0, _smallest(s.cov[:]))
    turn_sigma = math.sqrt(LEAST_TURN_SIGMA * LEAST_TURN_SIGMA + across2)
    row[TURN_SIGMA] = turn_sigma if least <= TILT_USABLE + unsure and unsure < TILT_KNOWN else -turn_sigma
    return True


@compiled
def _smallest(S: Array) -> float:
    """The smallest eigenvalue of a symmetric matrix, shape (3, 3) (O. Smith, Eigenvalues of a symmetric 3x3, 1961)."""
    mean: float = (S[0, 0] + S[1, 1] + S[2, 2]) / 3.0
    a, b, c, d, e, f = S[0, 0] - mean, S[1, 0], S[2, 0], S[1, 1] - mean, S[2, 1], S[2, 2] - mean
    p = math.sqrt((a * a + d * d + f * f + 2.0 * (b * b + c * c + e * e)) / 6.0)
    if p == 0.0:
        return mean
    half_det = 0.5 * (a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)) / (p * p * p)
    angle = (math.acos(min(max(half_det, -1.0), 1.0)) + math.tau) / 3.0
    return mean + 2.0 * p * math.cos(angle)


@compiled
def _rate(s: Foot, i: int, x: Array) -> Vector:
    """The turning at event i, rad/s, of the sample behind it, or before the newest event."""
    j = i + 1 if i + 1 < s.n else i - 1
    if s.rows[j, KIND] == IMU:
        return s.rows[j, GYRO] - x[13], s.rows[j, GYRO + 1] - x[14], s.rows[j, GYRO + 2] - x[15]
    return s.last[GYRO] - x[13], s.last[GYRO + 1] - x[14], s.last[GYRO + 2] - x[15]


@compiled
def _judged(row: Array, x: Array, P: Array, rate: Vector) -> tuple[float, float, Vector]:
    """A fix against the state at its instant: squared Mahalanobis distances of place and of turn, residual (m)."""
    h, H, PH = np.empty(3), np.empty((3, NE)), np.empty((3, NE))
    point_model(x, vector(row, ARM), rate, x[16] - row[PLACED_DELAY], h, H)
    found, inverse = invert3(seen_through(P, H, row[POINT_COV : POINT_COV + 9].reshape(3, 3), PH))
    residual = (row[POINT] - h[0], row[POINT + 1] - h[1], row[POINT + 2] - h[2])
    y = turned(inverse, residual)
    place = residual[0] * y[0] + residual[1] * y[1] + residual[2] * y[2] if found else np.inf
    turn = 0.0
    if row[TURN_SIGMA] > 0.0:
        normal, across = turn_off(row, x)
        variance = squared(row[TURN_SIGMA])
        for i in range(3):
            for j in range(3):
                variance += normal[i] * P[6 + i, 6 + j] * normal[j]
        turn = across * across / variance
    return place, turn, residual
