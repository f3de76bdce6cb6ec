"""A foot with an IMU: the error-state filter over its timeline.

Late fixes are put where they belong and what came after is replayed; fixes are gated, and some that agree with each
other but not with us start the place anew (foot_filter_optical). The output is predicted and held (foot_filter_output).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.body.skeleton import BALL_SHARE
from foottrack_service.config import FootSettings, Placement
from foottrack_service.fusion.contact import QUIET, STATISTIC, UNREST
from foottrack_service.fusion.foot_filter_candidates import Rejected, fill_reset
from foottrack_service.fusion.foot_filter_doubt import NOT_OURS, SURE_SIGMA, Doubt
from foottrack_service.fusion.foot_filter_events import (
    ACCEPTED,
    ARM,
    FIX,
    GYRO,
    IMU,
    KIND,
    MEASURED_Q,
    PLACES,
    POINT,
    POINT_COV,
    TILT_SIGMA,
    TURN_SIGMA,
    ZERO_SIGMA,
)
from foottrack_service.fusion.foot_filter_kernel import NE
from foottrack_service.fusion.foot_filter_memory import DEPTH, MARKER, new_foot
from foottrack_service.fusion.foot_filter_models import attitude_error
from foottrack_service.fusion.foot_filter_optical import (
    DOUBTED,
    FAR,
    IMPOSSIBLE,
    STALE,
    TAKEN,
    UNUSED,
    Blob,
    implausible,
    settle_fix,
    take_fix,
)
from foottrack_service.fusion.foot_filter_output import CONTACT, predicted
from foottrack_service.fusion.foot_filter_range import SCALE, SEEN
from foottrack_service.fusion.foot_filter_sample import FIRST, JUMPED, LEFT_OUT, first_state, take_sample, upright
from foottrack_service.fusion.in_motion_alignment import InMotionAlignment
from foottrack_service.fusion.interface import ImuSample, Kind, Moves, OpticalFix, Verdict, Whereabouts
from foottrack_service.fusion.timeline import Timeline
from foottrack_service.fusion.whose_motion import moves
from foottrack_service.rotations import Array

FEET_APART = {"left": -0.1, "right": 0.1}
"""m: where a foot stands that only an IMU knows (PROTOCOL, results)."""
JUMP_S, JUMP_TURN_S = 0.01, 0.03
"""A clock that was set back goes on so long after the last sample; for so long nobody noticed how the foot turned."""
KNOWN_SIGMA = 0.25
"""m per axis: of a foot that may claim a fix."""


class InertialFilter:
    """One foot's IMU and the fixes that correct it. Times in ns (``newest`` is the last sample's), stage vectors."""

    def __init__(self, foot: FootSettings, side: Side, *, floor: bool) -> None:
        self._settings, self._side, self._use_floor = foot, side, floor
        self._foot = new_foot()
        self._timeline = Timeline(self._foot)
        record: Any = self._foot[0]
        self._last: Array = record["last"]
        self._stance, self._lock = record["stance"], record["lock"]
        self._acc, self._gyro, self._q = record["acc"], record["gyro"], record["q"]
        self._p, self._q_alt, self._cov = record["p"], record["q_alt"], record["cov"]
        self._head_p, self._head_q = record["head_p"], record["head_q"]
        self.begun = False
        """Whether there was a sample."""
        self._imu_yaw: float | None = None
        self._seen_yaw = False
        self._blob = Blob(foot)
        self.doubt = Doubt()
        self._alignment = InMotionAlignment(self._foot, self._timeline)
        self.other: Whereabouts = lambda kind, t: None
        """The other foot's ``target``, and its ``moves``."""
        self.other_moves: Moves = lambda frm, to: None
        self.set_floor(0.0)
        self.place(foot.imu)

    def place(self, imu: Placement) -> None:
        """The sensor's place on the shoe."""
        foot, settings = self._foot, self._settings
        self._imu_p, self._imu_q = np.array(imu.p), rot.normalised(np.array(imu.q))
        foot["ankle_arm"] = rot.unrotate(self._imu_q, -self._imu_p)
        ball = np.array([1.0, 1.0, BALL_SHARE]) * settings.toe.p
        foot["ball_arm"] = rot.unrotate(self._imu_q, ball - self._imu_p)
        sole = np.array([ball[0], -settings.ankle_height, ball[2]])
        foot["sole_arm"] = rot.unrotate(self._imu_q, sole - self._imu_p)
        foot["foot_up"] = rot.unrotate(self._imu_q, np.array([0.0, 1.0, 0.0]))
        foot["foot_to_sensor"] = rot.conjugate(self._imu_q)
        foot["marker_arm"] = rot.unrotate(self._imu_q, np.array(settings.marker.p) - self._imu_p)
        foot["sensor_to_marker"] = rot.multiply(rot.conjugate(np.array(settings.marker.q)), self._imu_q)
        self._place_blob()
        self.acquired = False

    def set_floor(self, height: float) -> None:
        """Floor height in the stage, m."""
        self._floor = height
        self._foot["floor"] = height + self._settings.ankle_height if self._use_floor else math.nan
        self._foot["range"] = 0.0

    def set_imu_yaw(self, yaw: float) -> None:
        """Yaw of the device's own frame in the stage, rad: counts until a tag shows the foot's."""
        self._imu_yaw = yaw

    def on_imu(self, sample: ImuSample) -> bool:
        """Take a sample. False: it is left out, without rate or attitude, or not finite, or from the past."""
        self._acc[:] = sample.acc
        has_gyro, has_q = sample.gyro is not None, sample.q is not None
        if has_gyro:
            self._gyro[:] = sample.gyro
        if has_q:
            self._q[:] = sample.q
        taken = take_sample(self._foot, sample.t, has_gyro, has_q)
        if taken == JUMPED:
            self._jump_to(sample.t)
            taken = take_sample(self._foot, sample.t, has_gyro, has_q)
        elif taken == FIRST:
            self._begin(sample)
        return bool(taken != LEFT_OUT)

    def on_fix(self, fix: OpticalFix) -> Verdict:
        """Take a fix where it belongs."""
        reason = implausible(fix)
        if reason is not None:
            return reason
        self._p[:], self._cov[:] = fix.p, fix.cov
        self._head_p[:], self._head_q[:] = fix.head.p, fix.head.q
        has_q, has_alt = fix.q is not None, fix.q_alt is not None
        if has_q:
            self._q[:] = fix.q
        if has_alt:
            self._q_alt[:] = fix.q_alt
        kind = DEPTH if fix.kind == "depth" else MARKER
        taken = take_fix(self._foot, fix.t, kind, has_q, has_alt, fix.strange)
        if taken in (TAKEN, DOUBTED) and self._alignment.holds(fix.t, self._foot["residual"][0]):
            settle_fix(self._foot, int(self._foot["fix_at"][0]), True, True)
            self._alignment.refine()
            taken = TAKEN
        if taken == TAKEN:
            self._accepted(fix)
            return Verdict.ACCEPTED
        return Verdict.UNUSED if taken == UNUSED else Verdict.STALE if taken == STALE else self._doubted(fix, taken)

    def moves(self, frm: int, to: int) -> bool | None:
        """Whether the foot swings, or stands, between two instants, ns (whose_motion)."""
        return moves(self._timeline, frm, to)

    def learn_blob(self, fix: OpticalFix) -> None:
        """A depth blob that is not needed, since the tag is seen, shows where on the shoe blobs lie."""
        if implausible(fix) is None and self.begun and self.acquired and fix.t <= self.newest:
            ankle, q, _, sd = self.predicted(fix.t)
            if sd < SURE_SIGMA:
                p = fix.p / (1.0 + self._foot["range"][0, SCALE])
                self._blob.learn(ankle, q, fix.head.p + rot.rotate(fix.head.q, p))
                self._place_blob()

    def move(self, p: Array, q: Array) -> None:
        """The stage moved, old to new: everything that is kept goes along."""
        timeline, n = self._timeline, self._timeline.n
        if n == 0:
            return
        matrix, turn = rot.to_matrix(q), np.eye(NE)
        for k in (0, 3, 6):
            turn[k : k + 3, k : k + 3] = matrix
        timeline.X[:n, 0:3] = timeline.X[:n, 0:3] @ matrix.T + p
        timeline.X[:n, 3:6] = timeline.X[:n, 3:6] @ matrix.T
        timeline.X[:n, 6:10] = rot.multiply(q, timeline.X[:n, 6:10])
        timeline.P[:n] = turn @ timeline.P[:n] @ turn.T
        self.doubt.moved(p, q)
        # Fixes of the old stage are in the checkpoints already; none of them may be replayed.
        timeline.restart(int(timeline.t[n - 1]))
        self._forget_motion()
        self._lock[:] = 0.0

    def lose(self) -> None:
        """The stage moved and nobody knows how: the place needs fixes that agree."""
        self.acquired, self._seen_yaw = False, False
        self.doubt.forget()
        self._forget_motion()
        if self._timeline.n:
            last = self._timeline.restart(int(self._timeline.t[self._timeline.n - 1]))
            self._timeline.P[last, range(3), range(3)] += 1.0
            self._timeline.P[last, 7, 7] += math.pi**2

    @property
    def acquired(self) -> bool:
        """Whether fixes have said where the foot is, and not too long ago."""
        return bool(self._foot["acquired"][0])

    @acquired.setter
    def acquired(self, value: bool) -> None:
        self._foot["acquired"] = value

    @property
    def knows_range(self) -> bool:
        """Whether the floor has shown by how much the camera's depths are too long."""
        return bool(self._foot["range"][0, SEEN] > 0.0)

    @property
    def newest(self) -> int:
        """Stamp of the last sample, ns."""
        return int(self._foot["newest"][0])

    @property
    def state(self) -> tuple[Array, Array]:
        """State (17,) and covariance (16, 16) after the newest event (foot_filter_kernel)."""
        i = self._timeline.n - 1
        return self._timeline.X[i], self._timeline.P[i]

    @property
    def last_row(self) -> Array:
        """The newest sample as the filter used it (foot_filter_events)."""
        return self._last.copy()

    @property
    def standing(self) -> bool:
        """Whether the whole foot stands, quietly."""
        return bool(self._last[ZERO_SIGMA] > 0.0 and self._stance[STATISTIC] < QUIET)

    @property
    def contact(self) -> bool:
        """Whether heel or toes stand."""
        return bool(self._lock[CONTACT])

    def predicted(self, t: int) -> tuple[Array, Array, Array, float]:
        """Ankle (m), attitude of the foot, velocity (m/s) and SD of the ankle per axis (m) at ``t``, ns."""
        found = predicted(self._foot, t)
        return found[0:3], found[3:7], found[7:10], float(found[10])

    def target(self, kind: Kind, t: int) -> tuple[Array, float] | None:
        """Where fixes of ``kind`` are expected at ``t``, stage, and its SD per axis, m; None while not well known."""
        if not self.acquired:
            return None
        ankle, q, _, sd = self.predicted(t)
        point = self._blob.point if kind == "depth" else np.array(self._settings.marker.p)
        return (ankle + rot.rotate(q, point), sd) if sd < KNOWN_SIGMA else None

    def _begin(self, sample: ImuSample) -> None:
        """The first sample has come: the foot stands where it stood."""
        q = upright(sample)
        if self._imu_yaw is not None and sample.q is not None:
            q = rot.multiply(rot.from_yaw(self._imu_yaw), q)
        else:
            q = rot.multiply(rot.from_yaw(-rot.yaw_of(rot.multiply(q, rot.conjugate(self._imu_q)))), q)
        ankle = np.array([FEET_APART[self._side], self._floor + self._settings.ankle_height, 0.0])
        x, P = first_state(q, ankle - rot.rotate(q, self._foot["ankle_arm"][0]), sample)
        self._timeline.X[0], self._timeline.P[0] = x, P
        self.begun = True

    def _place_blob(self) -> None:
        self._foot["blob_arm"] = rot.unrotate(self._imu_q, self._blob.point - self._imu_p)
        self._foot["blob_sigma"] = self._blob.sigma

    def _forget_motion(self) -> None:
        self._foot["seen"], self._foot["seen_speed"] = 0, 0.0

    def _accepted(self, fix: OpticalFix) -> None:
        t, moving = int(self._timeline.t[self._foot["fix_at"][0]]), bool(self._foot["seen_speed"][0] > 0.0)
        self.doubt.accept(t, fix.kind, float(self._stance[UNREST]), moving, fix.strange)

    def _doubted(self, fix: OpticalFix, taken: int) -> Verdict:
        """A fix that is not simply taken: the other foot's, or one that agrees with others that we are wrong."""
        timeline, i, unrest = self._timeline, int(self._foot["fix_at"][0]), float(self._stance[UNREST])
        t, row, off = int(timeline.t[i]), timeline.rows[i], self._foot["residual"][0].copy()
        point, arm = row[POINT : POINT + 3].copy(), row[ARM : ARM + 3].copy()
        sigma = math.sqrt(max(row[POINT_COV], row[POINT_COV + 4], row[POINT_COV + 8]))
        if float(off @ off) > NOT_OURS**2:
            if not fix.strange:
                self.doubt.whose.see(fix.t, fix.kind, point, sigma, self.moves, self.other_moves)
            if self.doubt.is_others(t, point, off, unrest, self.other(fix.kind, fix.t)):
                settle_fix(self._foot, i, False, False)
                return Verdict.IDENTITY
        if taken == FAR:
            settle_fix(self._foot, i, True, fix.strange)
            self._accepted(fix)
            return Verdict.ACCEPTED
        acquired = self.acquired
        if taken != IMPOSSIBLE and not (acquired and fix.strange):
            turn, lean = None, (0.0, 0.0)
            if row[TURN_SIGMA] != 0.0:
                error = attitude_error(tuple(row[MEASURED_Q : MEASURED_Q + 4].tolist()), timeline.X[i])
                turn, lean = float(error[1]) if row[TURN_SIGMA] > 0.0 else None, (float(error[0]), float(error[2]))
            rejected = Rejected(t, point, off, turn, math.sqrt(timeline.P[i, 7, 7]), sigma, arm, lean)
            known = math.sqrt(max(timeline.P[i].diagonal()[:3])) if acquired else None
            agreed = self.doubt.agreed(rejected, fix.kind, known, unrest)
            if agreed is not None:
                self._restart_from(agreed, fix)
                return Verdict.ACCEPTED
        settle_fix(self._foot, i, False, False)
        return Verdict.GATE if acquired or taken == IMPOSSIBLE else Verdict.UNCONFIRMED

    def _restart_from(self, agreed: list[Rejected], fix: OpticalFix) -> None:
        """Begin anew at the oldest of the fixes that agree, and take them all."""
        timeline = self._timeline
        i = timeline.place(agreed[0].t - 1)
        if i == 0:
            settle_fix(self._foot, 1, False, False)
            return
        q = timeline.X[i - 1, 6:10]
        toes = None
        if not self._seen_yaw:
            # Without a tag's attitude the toes point mostly where the head looks.
            foot_q = rot.multiply(q, rot.conjugate(self._imu_q))
            toes = float(rot.yaw_of(fix.head.q) - rot.yaw_of(foot_q))
        self._seen_yaw |= fill_reset(timeline.rows[i], agreed, q, toes)
        chosen = {k.t for k in agreed}
        for j in range(i + 1, timeline.n):
            # What others said meanwhile, and an earlier start from them, is overruled too.
            if timeline.rows[j, KIND] != IMU:
                timeline.rows[j, KIND] = FIX
                timeline.rows[j, ACCEPTED] = PLACES if int(timeline.t[j]) in chosen else 0.0
                if timeline.rows[i, TILT_SIGMA] > 0.0:
                    timeline.rows[j, TURN_SIGMA] = abs(timeline.rows[j, TURN_SIGMA])
        settle_fix(self._foot, i, False, False)
        self._alignment.begin(i)
        self._alignment.refine()
        self.acquired = True
        self._forget_motion()
        self._lock[:] = 0.0

    def _jump_to(self, t: int) -> None:
        """The device's clock was set back: go on from there, unsure; what a device's own attitude says still counts."""
        before = t - round(JUMP_S * 1e9)
        self._timeline.restart(before)
        self._foot["newest"] = before
        turned = JUMP_TURN_S * float(np.linalg.norm(self._last[GYRO : GYRO + 3]))
        self._timeline.P[0, range(6, 9), range(6, 9)] += turned**2
        self._timeline.P[0, range(3), range(3)] += 0.1**2
        self._timeline.P[0, range(3, 6), range(3, 6)] += 1.0
        self._stance[:] = 0.0
        self._foot["rest"] = 0.0
        self.acquired = False
        self.doubt.clear()
        self._forget_motion()
