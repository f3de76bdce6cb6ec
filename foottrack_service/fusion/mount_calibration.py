"""The camera's mount on the headset, estimated in use: a standing foot stays where it is while the head moves.

Per stance the target's place in the stage is one unknown point c. A small turn f and shift t (head frame) that the
configured mount lacks, and the depth's scale s, show as motion of what does not move:

    head.p + R p = c - R t + R [p]x f - R p s         (p: the target in the head frame, R: the head's attitude)

That is linear: weighted least squares over all stances, each point c eliminated at once (Schur complement). What was
found is applied on top of the configured mount: p' = exp(f) p + t.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from foottrack_protocol.messages import MountValues, Side
from foottrack_service import rotations as rot
from foottrack_service.fusion.foot_filter_optical import implausible
from foottrack_service.fusion.interface import OpticalFix
from foottrack_service.fusion.mount_kernel import COLUMNS, POINT, VALUE, collect
from foottrack_service.rotations import Array

PRIOR = np.array([0.03] * 3 + [0.02] * 3 + [0.005])
"""rad, m, 1: how wrong mounts and depth scales are at most, SD."""
HEAD_NOISE, HEAD_TURN_NOISE = 0.001, 0.0008
"""m, and rad times the distance: what the head pose adds."""
CORRELATED = 2.5
"""So many neighbouring pictures say the same: lens, head pose and corners err together."""
OUTLIER = 16.3
"""Chi-square, 3 degrees of freedom."""
MISFIT = 1.0
"""A stance that fits no mount was none, or was another shoe's."""
LEAST_OF_STANCE = 12
LONGEST_STANCE_S = 3.0
"""A longer one is cut: a person who stands shifts the feet a little."""
LONGEST_HOLE_S = 0.25
"""A foot that was not seen for longer may have stepped."""
RECENT_S = 15.0
SLIP_TURN, SLIP_SHIFT = math.radians(0.3), 0.005
"""rad, m: a mount that has moved by less has not slipped."""
SLIP_SIGMAS = 4.0
SLIP_STANCES = 3
"""So many stances in a row must say so."""
WORN_TURN, WORN_SHIFT = math.radians(0.1), 0.002
"""rad, m per axis SD: what taking the headset off and putting it on again does to a mount at most."""
GOOD_TURN, GOOD_SHIFT = math.radians(0.1), 0.002
"""rad, m per axis SD: what a calibration on request must reach."""

USEFUL_FOOT = 0.003
"""m per axis SD where the feet are: what the feet's filters leave in any case."""


@dataclass(frozen=True, slots=True)
class MountEstimate:
    """A correction of the mount, head frame: apply ``q``, then add ``p``."""

    p: Array
    """m."""
    q: Array
    sigma_p: float
    """m per axis."""
    sigma_q: float
    """rad per axis."""
    sigma_foot: float
    """m per axis: how unsure the correction is where the feet were seen. Turn and shift make up for each other there,
    so this is known long before either."""

    @property
    def good(self) -> bool:
        """Whether the mount itself is known."""
        return self.sigma_p <= GOOD_SHIFT and self.sigma_q <= GOOD_TURN

    @property
    def useful(self) -> bool:
        """Whether feet are better off with it."""
        return self.sigma_foot <= USEFUL_FOOT


@dataclass(slots=True)
class _Stance:
    begun: int
    ended: int
    n: int
    sums: Array
    """(11, 11), see mount_kernel."""
    p: Array
    """Sum of the targets' places in the head frame, m."""

    def information(self) -> tuple[Array, Array]:
        """What it says of the 7 unknowns with its own point eliminated: matrix (7, 7) and vector (7,)."""
        S = self.sums
        ways = S[:POINT, POINT:VALUE] @ _inverse(S[POINT:VALUE, POINT:VALUE])
        return S[:POINT, :POINT] - ways @ S[POINT:VALUE, :POINT], S[:POINT, VALUE] - ways @ S[POINT:VALUE, VALUE]

    def misfit(self, matrix: Array, vector: Array) -> float:
        """What no mount explains, per component: about 1 / CORRELATED for a foot that stood."""
        values, _ = _solved(matrix, vector)
        own = self.sums[POINT:VALUE, VALUE]
        explained = own @ np.linalg.solve(self.sums[POINT:VALUE, POINT:VALUE], own) + vector @ values
        return float(self.sums[VALUE, VALUE] - explained) / (3.0 * self.n)


class MountCalibrator:
    """Takes fixes of standing feet as the *configured* mount gave them, and tells what that mount lacks."""

    def __init__(self, known: MountValues | None = None) -> None:
        """``known``: what an earlier use found; the headset may have been taken off since."""
        self._open: dict[Side, _Stance] = {}
        self._matrix, self._vector, self._values = np.zeros((7, 7)), np.zeros(7), np.zeros(7)
        if known is not None:
            sigmas = [math.hypot(known.sigma_q, WORN_TURN)] * 3 + [math.hypot(known.sigma_p, WORN_SHIFT)] * 3
            self._values[:6] = np.concatenate([rot.to_rotation_vector(known.q), known.p])
            self._matrix[range(6), range(6)] = 1.0 / np.square(sigmas)
            self._vector = self._matrix @ self._values
        self._seen, self._fixes = np.zeros(3), 0
        self._recent: deque[tuple[int, Array, Array]] = deque()
        self._slipping = 0
        self.slips = 0
        """How often the mount was seen to have moved."""

    def add(self, side: Side, fix: OpticalFix, standing: bool) -> None:
        """A fix of one foot, in order, and whether that foot stands flat. Other kinds than "marker" are left out."""
        if fix.kind != "marker" or implausible(fix) is not None:
            return
        stance = self._open.get(side)
        over = stance is not None and (
            (fix.t - stance.begun) * 1e-9 > LONGEST_STANCE_S or (fix.t - stance.ended) * 1e-9 > LONGEST_HOLE_S
        )
        if over or (stance is not None and not standing):
            self._close(side)
            stance = None
        if not standing:
            return
        if stance is None:
            stance = self._open[side] = _Stance(fix.t, fix.t, 0, np.zeros((COLUMNS, COLUMNS)), np.zeros(3))
        noise = HEAD_NOISE**2 + HEAD_TURN_NOISE**2 * float(fix.p @ fix.p)
        picture = (stance.sums, self._values, fix.head.p, fix.head.q, fix.p, fix.cov, noise)
        if stance.n >= LEAST_OF_STANCE:
            # A mount that is not known yet moves what stands still: that is no outlier.
            slack = 4.0 if self._matrix.any() else 4.0 * CORRELATED**2
            if collect(*picture, 0.0) > OUTLIER * slack:
                return
        if math.isfinite(collect(*picture, 1.0 / CORRELATED)):
            stance.n, stance.ended, stance.p = stance.n + 1, fix.t, stance.p + fix.p

    def recentred(self) -> None:
        """The stage moved: stances that are under way lie in the old one."""
        self._open.clear()

    def estimate(self) -> MountEstimate | None:
        """What is known so far, None before the first stance is over."""
        if self._fixes == 0:
            return None
        values, covariance = _solved(self._matrix, self._vector)
        sd = np.sqrt(np.diag(covariance))
        effect = np.hstack([-_cross(self._seen / self._fixes), np.eye(3)])
        return MountEstimate(
            values[3:6],
            rot.from_rotation_vector(values[:3]),
            float(sd[3:6].max()),
            float(sd[:3].max()),
            math.sqrt(float(np.trace(effect @ covariance[:6, :6] @ effect.T)) / 3.0),
        )

    def _close(self, side: Side) -> None:
        stance = self._open.pop(side)
        if stance.n < LEAST_OF_STANCE:
            return
        matrix, vector = stance.information()
        if stance.misfit(matrix, vector) > MISFIT:
            return
        self._recent.append((stance.ended, matrix, vector))
        while (stance.ended - self._recent[0][0]) * 1e-9 > RECENT_S:
            self._recent.popleft()
        self._seen, self._fixes = self._seen + stance.p, self._fixes + stance.n
        self._matrix += matrix
        self._vector += vector
        self._notice_a_slip()
        self._values, _ = _solved(self._matrix, self._vector)

    def _notice_a_slip(self) -> None:
        recent_matrix = np.sum([r[1] for r in self._recent], axis=0)
        recent_vector = np.sum([r[2] for r in self._recent], axis=0)
        old_matrix, old_vector = self._matrix - recent_matrix, self._vector - recent_vector
        old, old_covariance = _solved(old_matrix, old_vector)
        new, new_covariance = _solved(recent_matrix, recent_vector)
        gap, sd = np.abs(new - old)[:6], np.sqrt(np.diag(old_covariance + new_covariance))[:6]
        least = np.array([SLIP_TURN] * 3 + [SLIP_SHIFT] * 3)
        slipped = len(self._recent) >= SLIP_STANCES and bool(((gap > SLIP_SIGMAS * sd) & (gap > least)).any())
        self._slipping = self._slipping + 1 if slipped else 0
        if self._slipping >= SLIP_STANCES:
            self.slips += 1
            self._slipping = 0
            self._matrix, self._vector = np.zeros((7, 7)), np.zeros(7)
            self._recent.clear()


def _solved(matrix: Array, vector: Array) -> tuple[Array, Array]:
    covariance = _inverse(matrix + np.diag(1.0 / PRIOR**2))
    return covariance @ vector, covariance


def _cross(v: Array) -> Array:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
