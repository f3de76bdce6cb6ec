"""One foot in the fusion core: what came from its sensors, in the filter's terms, counted."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, replace

import numpy as np

from foottrack_protocol.messages import FilterHealth, Imu, ImuValues, MountValues, Optical, Side
from foottrack_service import rotations as rot
from foottrack_service.config import Placement, Settings
from foottrack_service.fusion.filters import MakeFilter, make_filter
from foottrack_service.fusion.head_history import HeadHistory
from foottrack_service.fusion.interface import FootEstimate, HeadSample, ImuSample, Kind, OpticalFix, Target, Verdict
from foottrack_service.fusion.mount_watch import MountWatch
from foottrack_service.fusion.punctuality import Punctuality
from foottrack_service.rotations import Array

MOST_ACCELERATION = 1000.0
"""m/s^2. Feet reach 170; beyond this it is no measurement."""
MOST_RATE = 100.0
"""rad/s."""
MOST_DISTANCE = 20.0
"""m. No camera on a head sees its own feet further away."""
MOST_VARIANCE = 100.0
"""m^2."""
_DOUBTS = (Verdict.GATE, Verdict.UNCONFIRMED, Verdict.IDENTITY, Verdict.STALE)
WAIT_FOR_HEAD_S = 0.1
"""How long a fix waits for the head pose that brackets it."""


@dataclass(frozen=True, slots=True)
class _Waiting:
    kind: Kind
    t: int
    arrived: int
    body: Optical
    strange: bool


class Foot:
    """Takes a foot's messages, checks that they are plausible, and runs its filter."""

    def __init__(
        self,
        settings: Settings,
        side: Side,
        heads: HeadHistory,
        watch: MountWatch | None = None,
        make: MakeFilter = make_filter,
    ) -> None:
        self._settings, self._side, self._watch, self._make = settings, side, watch, make
        self._filter = make(settings, side)
        self._other: Foot | None = None
        self._heads = heads
        self._punctual: dict[Kind, Punctuality] = {"marker": Punctuality(), "depth": Punctuality()}
        self._delay_ns = round(settings.timing.imu_delay * 1e9)
        self._acc_bias: Array | None = None
        self._gyro_bias: Array | None = None
        self._mount: Placement | None = None
        self.imu_t: int | None = None
        """Stamp of the newest sample that was used, ns."""
        self._waiting: deque[_Waiting] = deque(maxlen=64)
        self._accepted: Counter[str] = Counter()
        self._rejected: Counter[str] = Counter()

    def beside(self, other: Foot) -> None:
        """The person has another foot."""
        self._other = other
        self._filter.beside(other.target, other.moves)

    def target(self, kind: Kind, t: int) -> Target | None:
        """Where fixes of ``kind`` are expected at ``t``, ns; None while that is not well known."""
        return self._filter.target(kind, t)

    def moves(self, frm: int, to: int) -> bool | None:
        """Whether the IMU shows the foot swinging, or standing, between two instants, ns; None: neither."""
        return self._filter.moves(frm, to)

    @property
    def health(self) -> FilterHealth:
        """What became of the measurements since the start."""
        return FilterHealth(accepted=dict(self._accepted), rejected=dict(self._rejected))

    def reject(self, reason: str) -> None:
        """Count a measurement that never reached the filter."""
        self._rejected[reason] += 1

    def on_imu(self, t: int, body: Imu) -> None:
        """A sample of the foot's IMU, stamped ``t`` ns."""
        if max(map(abs, body.acc)) > MOST_ACCELERATION or (body.gyro and max(map(abs, body.gyro)) > MOST_RATE):
            self.reject("implausible")
            return
        acc = np.array(body.acc)
        gyro = None if body.gyro is None else np.array(body.gyro)
        if self._acc_bias is not None:
            acc = acc - self._acc_bias
        if self._gyro_bias is not None and gyro is not None:
            gyro = gyro - self._gyro_bias
        q = None if body.q is None else np.array(body.q)
        if self._filter.on_imu(ImuSample(t - self._delay_ns, acc, gyro, q)):
            self._accepted["imu"] += 1
            self.imu_t = t
        else:
            self.reject("imu_stale")

    def on_optical(self, kind: Kind, t: int, body: Optical, now: int, heads_strange: bool) -> None:
        """A camera's fix made at ``t``, arriving at ``now`` (ns). It waits for ``settle`` and its head pose.

        ``heads_strange``: the headset's clock may have jumped.
        """
        if math.dist(body.p, (0.0, 0.0, 0.0)) > MOST_DISTANCE or max(map(abs, body.cov)) > MOST_VARIANCE:
            self.reject("implausible")
        elif self._punctual[kind].is_out_of_turn(t, now):
            self.reject(Verdict.STALE)
        elif self._heads.newest is None:
            self.reject(Verdict.NO_HEAD_POSE)
        else:
            strange = self._punctual[kind].is_strange(t, now) or heads_strange
            if len(self._waiting) == self._waiting.maxlen:
                self.reject(Verdict.NO_HEAD_POSE)
            self._waiting.append(_Waiting(kind, t, now, body, strange))

    def settle(self, now: int) -> None:
        """Hand the waiting fixes whose head pose is known by now to the filter, in order."""
        while self._waiting:
            first = self._waiting[0]
            newest = self._heads.newest
            at_picture = self._heads.at(first.t)
            if at_picture is None and newest is not None and not self._filter.waits_for_head:
                at_picture = newest
            if at_picture is None or newest is None:
                if (now - first.arrived) * 1e-9 < WAIT_FOR_HEAD_S:
                    return
                self.reject(Verdict.NO_HEAD_POSE)
            else:
                self._fuse(first, at_picture, newest, now)
            self._waiting.popleft()

    def on_floor(self, height: float) -> None:
        """The floor was calibrated, m."""
        self._filter.on_floor(height)

    def on_imu_yaw(self, yaw: float) -> None:
        """The device's yaw in the stage was calibrated, rad."""
        self._filter.on_imu_yaw(yaw)

    def on_imu_calibration(self, values: ImuValues) -> None:
        """Biases and the sensor's place on the shoe."""
        self._acc_bias, self._gyro_bias = np.array(values.acc_bias), np.array(values.gyro_bias)
        self._filter.on_imu_placement(Placement(p=values.p, q=values.q))

    def on_mount(self, values: MountValues) -> None:
        """A correction of the camera's mount, if it was found for the mount that is configured."""
        if values.base == self._settings.camera.mount_hash:
            self._mount = Placement(p=values.p, q=values.q)

    def on_head_lost(self) -> None:
        """The headset does not know where it is."""
        self._filter.on_head_lost()

    def on_recentred(self, p: Array | None, q: Array | None) -> None:
        """The stage moved, old to new; None when nobody knows how. Fixes that wait belong to the old one."""
        for _ in range(len(self._waiting) if p is None else 0):
            self._waiting.popleft()
            self.reject(Verdict.NO_HEAD_POSE)
        self._filter.on_recentred(p, q)

    def estimate(self, t: int) -> FootEstimate | None:
        """The foot at ``t`` ns, None when unknown or no longer a number."""
        found = self._filter.estimate(t)
        if found is None:
            return None
        if not math.isfinite(sum(found.p.tolist()) + sum(found.q.tolist()) + sum(found.v.tolist()) + found.sigma):
            # A filter that lost its numbers starts again from the next measurement and never speaks them.
            self.reject("not_finite")
            self._filter = self._make(self._settings, self._side)
            if self._other is not None:
                self._filter.beside(self._other.target, self._other.moves)
            return None
        return found

    def _fuse(self, waiting: _Waiting, head: HeadSample, newest: HeadSample, now: int) -> None:
        body = waiting.body
        p = np.array(body.p)
        q = None if body.q is None else np.array(body.q)
        q_alt = None if body.q_alt is None else np.array(body.q_alt)
        xx, xy, xz, yy, yz, zz = body.cov
        cov = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        seen = (p, q, q_alt, cov, body.size_ratio, body.edge_px)
        fix = OpticalFix(waiting.t, waiting.kind, *seen, head, newest, waiting.strange)
        if self._watch is not None and fix.strange:
            self._watch.doubt(fix.t)
        verdict = self._filter.on_fix(self._mounted(fix), now)
        if verdict is not Verdict.ACCEPTED:
            self._rejected[verdict] += 1
            if self._watch is not None and verdict in _DOUBTS:
                self._watch.doubt(fix.t)
            return
        self._accepted[waiting.kind] += 1
        if self._watch is not None:
            self._watch.add(self._side, fix, self._filter.standing)

    def _mounted(self, fix: OpticalFix) -> OpticalFix:
        """The fix as the corrected mount gives it."""
        if self._mount is None:
            return fix
        turn = np.array(self._mount.q)
        matrix = rot.to_matrix(turn)
        return replace(
            fix,
            p=rot.rotate(turn, fix.p) + np.array(self._mount.p),
            q=None if fix.q is None else rot.multiply(turn, fix.q),
            q_alt=None if fix.q_alt is None else rot.multiply(turn, fix.q_alt),
            cov=matrix @ fix.cov @ matrix.T,
        )
