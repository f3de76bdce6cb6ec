"""A foot with an IMU: the error-state filter over its timeline.

Late fixes are put where they belong and what came after is replayed; fixes are gated, and some that agree with each
other but not with us start the place anew (foot_filter_optical). The output is predicted and held (foot_filter_output).
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings, Placement
from foottrack_service.fusion.contact import QUIET, STATISTIC, UNREST, SeenMotion, stance_sigma
from foottrack_service.fusion.foot_filter_candidates import Rejected, fill_reset
from foottrack_service.fusion.foot_filter_doubt import NOT_OURS, SURE_SIGMA, Doubt
from foottrack_service.fusion.foot_filter_events import (
    ACCEPTED,
    ARM,
    COLUMNS,
    FIX,
    FLOOR,
    GYRO,
    IMU,
    KIND,
    MEASURED_Q,
    POINT,
    POINT_COV,
    QUIET_FLAG,
    TURN_SIGMA,
    ZERO_SIGMA,
)
from foottrack_service.fusion.foot_filter_kernel import NE
from foottrack_service.fusion.foot_filter_optical import (
    CHI_SQUARE_1,
    CHI_SQUARE_3,
    OLDEST_S,
    Blob,
    FixRows,
    implausible,
    judged,
)
from foottrack_service.fusion.foot_filter_output import CONTACT, follow, predicted
from foottrack_service.fusion.foot_filter_replay import (
    ANKLE_ARM,
    FOOT_UP,
    HOLE_S,
    attitude_error,
    replay,
    smallest_variances,
)
from foottrack_service.fusion.foot_filter_sample import SampleRows, first_state, upright, usable
from foottrack_service.fusion.interface import FIX_MEMORY_S, ImuSample, Kind, OpticalFix, Verdict, Whereabouts
from foottrack_service.fusion.timeline import Timeline
from foottrack_service.rotations import Array

FEET_APART = {"left": -0.1, "right": 0.1}
"""m: where a foot stands that only an IMU knows (PROTOCOL, results)."""
QUIET_STATISTIC = 0.25
"""A foot this quiet shows its gyro's bias."""
JUMPED_AFTER = 4
"""So many samples in a row from the past: the device's clock was set back."""
UNSURE_AFTER_S = 0.25
"""A hole in the IMU after which the place needs fixes that agree."""
UNSURE_SIGMA = 0.3
"""m per axis: likewise."""
KNOWN_SIGMA = 0.1
"""m per axis: of a foot that may claim a fix."""


class InertialFilter:
    """One foot's IMU and the fixes that correct it. Times in ns (``newest`` is the last sample's), stage vectors."""

    def __init__(self, foot: FootSettings, side: Side, *, floor: bool) -> None:
        self._foot, self._side, self._use_floor = foot, side, floor
        self._floor = 0.0
        self._timeline, self._smallest = Timeline(), smallest_variances()
        self._samples = SampleRows()
        self._last: Array = np.zeros(COLUMNS)
        self.newest, self._behind = 0, 0
        self._memory, self._lock = np.zeros(4), np.zeros(9)
        self._imu_yaw: float | None = None
        self._seen_yaw = False
        self._blob = Blob(foot)
        self._motion = SeenMotion()
        self.doubt = Doubt()
        self.other: Whereabouts = lambda kind, t: None
        """The other foot's ``target``."""
        self.acquired = False
        """Whether fixes have said where the foot is, and not too long ago."""
        self.place(foot.imu)

    def place(self, imu: Placement) -> None:
        """The sensor's place on the shoe."""
        foot = self._foot
        p, self._imu_q = np.array(imu.p), rot.normalised(np.array(imu.q))
        self._geometry = np.zeros(6)
        self._geometry[ANKLE_ARM : ANKLE_ARM + 3] = rot.unrotate(self._imu_q, -p)
        self._geometry[FOOT_UP : FOOT_UP + 3] = rot.unrotate(self._imu_q, np.array([0.0, 1.0, 0.0]))
        self._toe_arm = rot.unrotate(self._imu_q, np.array(foot.toe.p) - p)
        self._fix_rows = FixRows(foot, p, self._imu_q, self._blob)
        self.acquired = False

    def set_floor(self, height: float) -> None:
        """Floor height in the stage, m."""
        self._floor = height

    def set_imu_yaw(self, yaw: float) -> None:
        """Yaw of the device's own frame in the stage, rad: counts until a tag shows the foot's."""
        self._imu_yaw = yaw

    def on_imu(self, sample: ImuSample) -> None:
        """Take a sample. Without rate or attitude, or not finite, or from the past, it is left out."""
        if not usable(sample):
            return
        timeline = self._timeline
        if timeline.n == 0:
            self._begin(sample)
            return
        if sample.t <= self.newest:
            self._behind += 1
            if self._behind < JUMPED_AFTER:
                return
            self._jump_to(sample.t)
        self._behind = 0
        dt = (sample.t - self.newest) * 1e-9
        if dt > UNSURE_AFTER_S:
            self.acquired = False
        i = timeline.place(sample.t)
        if i == 0:
            return
        row = timeline.rows[i]
        self._samples.fill(row, sample, dt)
        sigma = stance_sigma(timeline.t, timeline.rows, i, dt, timeline.X[i - 1], timeline.P[i - 1], self._memory)
        if sigma > 0.0:
            row[ZERO_SIGMA] = math.hypot(sigma, self._motion.speed)
            row[QUIET_FLAG] = float(self._memory[STATISTIC] < QUIET_STATISTIC and self._motion.speed == 0.0)
        row[FLOOR] = self._floor + self._foot.ankle_height if self._use_floor else math.nan
        self._replay(i)
        follow(self._lock, row, timeline.X[timeline.n - 1], self._toe_arm, min(dt, HOLE_S))
        self.newest, self._last = sample.t, row.copy()

    def on_fix(self, fix: OpticalFix) -> Verdict:
        """Take a fix where it belongs."""
        reason = implausible(fix)
        if reason is not None:
            return reason
        timeline = self._timeline
        if timeline.n == 0 or fix.t > self.newest + FIX_MEMORY_S * 1e9:
            return Verdict.UNUSED
        if fix.t < self.newest - OLDEST_S * 1e9:
            return Verdict.STALE
        delay = float(np.clip(timeline.X[timeline.n - 1, 16], -0.05, 0.05))
        t = fix.t + round(delay * 1e9)
        i = timeline.place(t)
        if i == 0:
            return Verdict.STALE
        row = timeline.rows[i]
        row[KIND] = FIX
        attitudes = self._fix_rows.fill(row, fix, delay)
        replay(timeline.t, timeline.rows, timeline.X, timeline.P, i, i + 1, self._geometry, self._smallest)
        x, P = timeline.X[i], timeline.P[i]
        ours = self._fix_rows.take_attitude(row, fix, attitudes, x)
        place, turned_by, residual = judged(row, x, P, self._rate(i))
        if math.sqrt(max(P[0, 0], P[1, 1], P[2, 2])) > UNSURE_SIGMA:
            self.acquired = False
        good = ours and place <= CHI_SQUARE_3 and turned_by <= CHI_SQUARE_1
        point, off = row[POINT : POINT + 3].copy(), np.array(residual)
        if float(off @ off) > NOT_OURS**2:
            other = self.other(fix.kind, fix.t)
            if self.doubt.is_others(t, point, off, self._memory[UNREST], other):
                self._replay(i)
                return Verdict.IDENTITY
        if self.acquired and good:
            self._accept(i, t, fix.kind)
            return Verdict.ACCEPTED
        acquired = self.acquired
        if ours:
            turn = None
            if row[TURN_SIGMA] > 0.0:
                turn = float(attitude_error(row[MEASURED_Q : MEASURED_Q + 4], x)[1])
            sigma = math.sqrt(max(row[POINT_COV], row[POINT_COV + 4], row[POINT_COV + 8]))
            rejected = Rejected(t, point, off, turn, sigma, row[ARM : ARM + 3].copy())
            known = math.sqrt(max(P[0, 0], P[1, 1], P[2, 2])) if acquired else None
            agreed = self.doubt.agreed(rejected, fix.kind, known, self._memory[UNREST])
            if agreed is not None:
                self._restart_from(agreed, fix)
                return Verdict.ACCEPTED
        self._replay(i)
        return Verdict.GATE if acquired or not ours else Verdict.UNCONFIRMED

    def learn_blob(self, fix: OpticalFix) -> None:
        """A depth blob that is not needed, since the tag is seen, shows where on the shoe blobs lie."""
        if implausible(fix) is None and self.begun and self.acquired and fix.t <= self.newest:
            ankle, q, _, sd = self.predicted(fix.t)
            if sd < SURE_SIGMA:
                self._blob.learn(ankle, q, fix.head.p + rot.rotate(fix.head.q, fix.p))

    def move(self, p: Array, q: Array) -> None:
        """The stage moved, old to new: everything that is kept goes along."""
        timeline = self._timeline
        n = timeline.n
        if n == 0:
            return
        matrix = rot.to_matrix(q)
        turn = np.eye(NE)
        for k in (0, 3, 6):
            turn[k : k + 3, k : k + 3] = matrix
        timeline.X[:n, 0:3] = timeline.X[:n, 0:3] @ matrix.T + p
        timeline.X[:n, 3:6] = timeline.X[:n, 3:6] @ matrix.T
        timeline.X[:n, 6:10] = rot.multiply(q, timeline.X[:n, 6:10])
        timeline.P[:n] = turn @ timeline.P[:n] @ turn.T
        self.doubt.moved(p, q)
        # Fixes of the old stage are in the checkpoints already; none of them may be replayed.
        timeline.restart(int(timeline.t[n - 1]))
        self._motion.clear()
        self._lock[:] = 0.0

    def lose(self) -> None:
        """The stage moved and nobody knows how: the place needs fixes that agree."""
        self.acquired, self._seen_yaw = False, False
        self.doubt.forget()
        self._motion.clear()
        if self._timeline.n:
            last = self._timeline.restart(int(self._timeline.t[self._timeline.n - 1]))
            self._timeline.P[last, range(3), range(3)] += 1.0
            self._timeline.P[last, 7, 7] += math.pi**2

    @property
    def begun(self) -> bool:
        """Whether there was a sample."""
        return self._timeline.n > 0

    @property
    def state(self) -> tuple[Array, Array]:
        """State (17,) and covariance (16, 16) after the newest event (foot_filter_kernel)."""
        i = self._timeline.n - 1
        return self._timeline.X[i], self._timeline.P[i]

    @property
    def last_row(self) -> Array:
        """The newest sample as the filter used it (foot_filter_events)."""
        return self._last

    @property
    def standing(self) -> bool:
        """Whether the whole foot stands, quietly."""
        return bool(self._last[ZERO_SIGMA] > 0.0 and self._memory[STATISTIC] < QUIET)

    @property
    def contact(self) -> bool:
        """Whether heel or toes stand."""
        return bool(self._lock[CONTACT])

    def predicted(self, t: int) -> tuple[Array, Array, Array, float]:
        """Ankle (m), attitude of the foot, velocity (m/s) and SD of the ankle per axis (m) at ``t``, ns."""
        timeline = self._timeline
        i = timeline.n - 1
        dt = min((t - int(timeline.t[i])) * 1e-9, 1.0)
        out = predicted(self._last, timeline.X[i], timeline.P[i], self._lock, self._geometry, max(dt, -HOLE_S))
        q = rot.multiply(out[3:7], rot.conjugate(self._imu_q))
        return out[0:3], q, out[7:10], math.sqrt(out[10] / 3.0)

    def target(self, kind: Kind, t: int) -> Array | None:
        """Where in the stage fixes of ``kind`` are expected at ``t``, m; None while that is not well known."""
        if not self.acquired:
            return None
        ankle, q, _, sd = self.predicted(t)
        point = self._blob.point if kind == "depth" else np.array(self._foot.marker.p)
        return ankle + rot.rotate(q, point) if sd < KNOWN_SIGMA else None

    def _begin(self, sample: ImuSample) -> None:
        q = upright(sample)
        if q is None:
            return
        if self._imu_yaw is not None and sample.q is not None:
            q = rot.multiply(rot.from_yaw(self._imu_yaw), q)
        else:
            q = rot.multiply(rot.from_yaw(-rot.yaw_of(rot.multiply(q, rot.conjugate(self._imu_q)))), q)
        timeline = self._timeline
        i = timeline.append(sample.t)
        self._samples.fill(timeline.rows[i], sample, 0.0)
        ankle = np.array([FEET_APART[self._side], self._floor + self._foot.ankle_height, 0.0])
        x, P = first_state(q, ankle - rot.rotate(q, self._geometry[ANKLE_ARM : ANKLE_ARM + 3]), sample)
        timeline.X[i], timeline.P[i] = x, P
        self.newest, self._last = sample.t, timeline.rows[i].copy()

    def _replay(self, start: int) -> None:
        timeline = self._timeline
        replay(timeline.t, timeline.rows, timeline.X, timeline.P, start, timeline.n, self._geometry, self._smallest)

    def _rate(self, i: int) -> Array:
        rows = self._timeline.rows
        j = i + 1 if i + 1 < self._timeline.n else i - 1
        near = rows[j] if rows[j, KIND] == IMU else self._last
        rate: Array = near[GYRO : GYRO + 3] - self._timeline.X[i, 13:16]
        return rate

    def _accept(self, i: int, t: int, kind: Kind) -> None:
        timeline = self._timeline
        row = timeline.rows[i]
        row[ACCEPTED] = 1.0
        self._motion.see(t, row[POINT : POINT + 3].copy())
        self.doubt.accept(t, kind, self._memory[UNREST], self._motion.speed > 0.0)
        if self._motion.speed > 0.0:
            sigmas = timeline.rows[i + 1 : timeline.n, ZERO_SIGMA]
            sigmas[sigmas > 0.0] = np.maximum(sigmas[sigmas > 0.0], self._motion.speed)
        self._replay(i)

    def _restart_from(self, agreed: list[Rejected], fix: OpticalFix) -> None:
        """Begin anew at the oldest of the fixes that agree, and take them all."""
        timeline = self._timeline
        i = timeline.insert(agreed[0].t - 1)
        if i == 0:
            self._replay(1)
            return
        q = timeline.X[i - 1, 6:10]
        toes = None
        if not self._seen_yaw:
            # Without a tag's attitude the toes point mostly where the head looks.
            foot_q = rot.multiply(q, rot.conjugate(self._imu_q))
            toes = float(rot.yaw_of(fix.head.q) - rot.yaw_of(foot_q))
        self._seen_yaw |= fill_reset(timeline.rows[i], agreed, q, toes)
        chosen = {k.t for k in agreed}
        for j in range(i, timeline.n):
            if timeline.rows[j, KIND] == FIX and int(timeline.t[j]) in chosen:
                timeline.rows[j, ACCEPTED] = 1.0
        self._replay(i)
        self.acquired = True
        self._motion.clear()
        self._lock[:] = 0.0

    def _jump_to(self, t: int) -> None:
        """The device's clock was set back: go on from there, unsure."""
        self._timeline.restart(t - 1)
        self.newest = t - 1
        self._timeline.P[0, range(3), range(3)] += 0.1**2
        self._timeline.P[0, range(3, 6), range(3, 6)] += 1.0
        self._memory[:] = 0.0
        self.acquired = False
        self.doubt.clear()
        self._motion.clear()
        self._samples.forget()
