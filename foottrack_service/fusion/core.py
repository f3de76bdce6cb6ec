"""The fusion core: messages in, messages out, and no clock of its own.

The same messages at the same instants give the same results to the bit, so a recording can be replayed offline.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.frames import MAX_HEAD_GAP_S, SIDES
from foottrack_protocol.messages import (
    BodyCalibration,
    BodyPose,
    FilterHealth,
    FloorCalibration,
    FootPose,
    HeadingCalibration,
    HeadPose,
    ImuCalibration,
    MountCalibration,
    Pose,
    Side,
)
from foottrack_service import rotations as rot
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.body.solver import BodySolver, FootPlace, Legs
from foottrack_service.config import Settings
from foottrack_service.fusion.filters import MakeFilter, make_filter
from foottrack_service.fusion.foot import Foot
from foottrack_service.fusion.gait_link import GaitLink
from foottrack_service.fusion.head_history import HeadHistory
from foottrack_service.fusion.interface import FootEstimate, HeadSample, Kind
from foottrack_service.fusion.mount_watch import MountWatch
from foottrack_service.fusion.plausible import MOST_DISTANCE, is_plausible, within
from foottrack_service.fusion.punctuality import Punctuality
from foottrack_service.rotations import Array

SOURCE = "fusion"
_PAUSE_NS = 3_000_000
"""What fusing a picture's two fixes may take, on a core that was asleep (measured: 1 ms)."""
_TAKEN = ("imu", "marker", "depth", "head", "calibration")
"""What is fused, of all that a recording holds."""
_AHEAD_NS = 100_000_000
"""What is stamped by so much later than it arrives comes from a clock that is wrong. (A clock over the network is known
to a few ms, and a runtime may predict its poses to the next frame or two.)"""

_log = logging.getLogger(__name__)


class FusionCore:
    """Fuses one user's measurements into ``pose/body``, and what follows from it: ``pose/ik`` and ``gait/*``.

    ``sink`` hears of each result as soon as it is known, so that a pose is on its way before the gait is computed; the
    same results are returned.
    """

    def __init__(
        self,
        settings: Settings,
        sid: str = "offline",
        sink: Callable[[Message], Any] | None = None,
        make: MakeFilter = make_filter,
    ) -> None:
        self._sink = sink
        self._user = settings.user
        self._sid = sid
        self._body = BodySolver(Skeleton.of(settings.body), settings.body.solver)
        self._gait = GaitLink(settings, self._body.skeleton)
        self._heads, self._head_punctual, self._heads_strange = HeadHistory(), Punctuality(), False
        self._origin: int | None = None
        self._calibrated: dict[tuple[str, Side | None], Any] = {}
        self._warned: set[str] = set()
        watched = settings.fusion.mount_calibration and settings.fusion.filter == "error-state"
        self._watch = MountWatch(settings.camera) if watched else None
        self._feet: dict[Side, Foot] = {side: Foot(settings, side, self._heads, self._watch, make) for side in SIDES}
        self._feet["left"].beside(self._feet["right"])
        self._feet["right"].beside(self._feet["left"])
        self._toes = {side: np.array(settings.feet.of(side).toe.p) for side in SIDES}
        self._shortest_ns = round(1e9 / settings.fusion.max_output_hz)
        self._silence_ns = round(settings.fusion.silence * 1e9)
        self._last_output: int | None = None
        self._due: dict[Side, int | None] = {}
        self._started = False
        self._seq: dict[str, int] = {}

    @property
    def health(self) -> dict[str, FilterHealth]:
        """Accepted and rejected measurements by ``user/side``; what was bad for both feet counts for each."""
        return {f"{self._user}/{side}": foot.health for side, foot in self._feet.items()}

    @property
    def mount_health(self) -> FilterHealth | None:
        """Of the camera's mount (mount_watch); None when nobody watches it."""
        return None if self._watch is None else self._watch.health

    @property
    def deadline(self) -> int | None:
        """When the timer has to publish because nothing came; None before anything is known. ns."""
        return None if self._last_output is None else self._last_output + self._silence_ns

    def handle(self, message: Message, now: int) -> list[Message]:
        """Take a message that arrives at ``now`` (ns, never falling) and give what it brings on."""
        if message.user != self._user:
            return []
        kind, _, tail = message.stream.partition("/")
        side: Side | None = "left" if tail == "left" else "right" if tail == "right" else None
        if kind in _TAKEN and (message.t - now > _AHEAD_NS or not message.valid):
            self._reject("ahead" if message.valid else "invalid", side)
            return []
        if kind == "imu" and side:
            return self._on_imu(side, message, now)
        if kind == "marker" and side:
            self._on_optical(side, "marker", message, now)
        elif kind == "depth" and side:
            self._on_optical(side, "depth", message, now)
        elif message.stream == "head/pose":
            self._on_head(message.t, message.data, now)
        elif message.stream == "calibration" and (message.src != SOURCE or self._watch is None):
            # Our own comes back from the bus, and is in recordings: whoever watches finds it again.
            self._on_calibration(message.data)
        if self._last_output is None and self._started:
            return self._publish(now)
        return []

    def tick(self, now: int) -> list[Message]:
        """The timer: publishes when nothing has been published for 20 ms."""
        deadline = self.deadline
        if deadline is None or now < deadline:
            return []
        self._fuse_pictures(now)
        return self._publish(now)

    def _on_imu(self, side: Side, message: Message, now: int) -> list[Message]:
        previous = self._feet[side].imu_t
        self._feet[side].on_imu(message.t, message.data)
        self._started = True
        limited = self._last_output is not None and now - self._last_output < self._shortest_ns
        results = [] if limited else self._publish(now)
        self._fuse_pictures(now)
        period = 0 if previous is None else message.t - previous
        self._due[side] = now + period if 0 < period <= self._silence_ns else None
        return results

    def _on_optical(self, side: Side, kind: Kind, message: Message, now: int) -> None:
        self._feet[side].on_optical(kind, message.t, message.data, now, self._heads_strange)
        self._started = True
        self._fuse_pictures_in_a_pause(now)

    def _fuse_pictures(self, now: int) -> None:
        for foot in self._feet.values():
            foot.settle(now)

    def _fuse_pictures_in_a_pause(self, now: int) -> None:
        """A sample is owed its pose at once, a picture is some 40 ms old anyway: what would be in a sample's way waits
        until after it. One that is late may be lost, and is waited for only so long."""
        if not any(due is not None and -self._silence_ns < due - now < _PAUSE_NS for due in self._due.values()):
            self._fuse_pictures(now)

    def _on_head(self, t: int, body: HeadPose, now: int) -> None:
        if self._origin is not None and body.origin != self._origin:
            moved = body.moved if body.moved is not None and within(body.moved.p, MOST_DISTANCE) else None
            p, q = (None, None) if moved is None else (np.array(moved.p), np.array(moved.q))
            if p is None or q is None:
                self._heads.clear()
            else:
                self._heads.move(p, q)
            for foot in self._feet.values():
                foot.on_recentred(p, q)
            if self._watch is not None:
                self._watch.recentred()
            self._body.reset()
        self._origin = body.origin
        self._heads_strange = self._head_punctual.is_strange(t, now)
        far = not within(body.p or (), MOST_DISTANCE)
        if far:
            self._reject("implausible")
        if not body.tracked or body.p is None or body.q is None or far:
            self._heads.add_untracked(t)
            for foot in self._feet.values():
                foot.on_head_lost()
        else:
            self._heads.add(HeadSample(t, np.array(body.p), np.array(body.q)))
            self._started = True
        self._fuse_pictures_in_a_pause(now)

    def _on_calibration(self, found: Any) -> None:
        if not is_plausible(found):
            self._reject("implausible", found.values.side if isinstance(found, ImuCalibration) else None)
            if found.kind not in self._warned:
                self._warned.add(found.kind)
                _log.warning("a calibration (%s) is left out, for nothing is like that: %s", found.kind, found.values)
            return
        # Every calibration comes again every 5 s, and a filter that is placed anew has to find its foot again. Only one
        # that began anew (foot.py) needs it again.
        kind = (found.kind, found.values.side if isinstance(found, ImuCalibration) else None)
        known = (found, sum(foot.health.rejected.get("not_finite", 0) for foot in self._feet.values()))
        if self._calibrated.get(kind) == known:
            return
        self._calibrated[kind] = known
        if isinstance(found, FloorCalibration):
            for foot in self._feet.values():
                foot.on_floor(found.values.height)
        elif isinstance(found, BodyCalibration):
            self._body.skeleton = Skeleton.calibrated(found.values)
            self._gait.wear(self._body.skeleton)
        elif isinstance(found, HeadingCalibration):
            for side, foot in self._feet.items():
                yaw = getattr(found.values.imu_yaw, side)
                if yaw is not None:
                    foot.on_imu_yaw(yaw)
        elif isinstance(found, ImuCalibration):
            self._feet[found.values.side].on_imu_calibration(found.values)
        elif isinstance(found, MountCalibration):
            if self._watch is not None:
                if self._watch.said(found.values):
                    return
                self._watch.restart(found.values)
            for foot in self._feet.values():
                foot.on_mount(found.values)

    def _reject(self, reason: str, side: Side | None = None) -> None:
        for foot in self._feet.values() if side is None else (self._feet[side],):
            foot.reject(reason)

    def _publish(self, now: int) -> list[Message]:
        self._last_output = now
        feet: dict[Side, FootEstimate] = {}
        for side, foot in self._feet.items():
            found = foot.estimate(now)
            if found is not None:
                feet[side] = found
        head = self._heads.newest
        if head is not None and abs(now - head.t) * 1e-9 > MAX_HEAD_GAP_S:
            head = None
        legs = None
        places = {side: FootPlace(_vec(found.p), _quat(found.q)) for side, found in feet.items()}
        if head is None:
            self._body.face(now, None, places)
        else:
            legs = self._body.solve(now, head.p.tolist(), head.q.tolist(), places)
        body = BodyPose(
            head=None if head is None else _pose(head.p, head.q),
            hips=None if legs is None else Pose(p=legs.hips, q=legs.hips_q),
            left=self._foot_pose("left", feet.get("left"), legs),
            right=self._foot_pose("right", feet.get("right"), legs),
        )
        pose = self._message("pose/body", now, now, body)
        imu_t = {side: foot.imu_t for side, foot in self._feet.items()}
        gait = self._gait.update(now, feet, imu_t, head, self._body.yaw)
        return [
            pose,
            self._message("pose/ik", now, now, gait.ik),
            self._message("gait/state", now, now, gait.state),
            *(self._message("gait/event", t, now, event) for t, event in gait.events),
            *self._mount_found(now),
        ]

    def _mount_found(self, now: int) -> list[Message]:
        found = None if self._watch is None else self._watch.found(now)
        if found is None:
            return []
        for foot in self._feet.values():
            foot.on_mount(found.values)
        return [self._message("calibration", now, now, found)]

    def _foot_pose(self, side: Side, found: FootEstimate | None, legs: Legs | None) -> FootPose | None:
        if found is None:
            return None
        return FootPose(
            hip=None if legs is None else legs.joints[side],
            knee=None if legs is None else legs.knees[side],
            ankle=_pose(found.p, found.q),
            toe=_vec(found.p + rot.rotate(found.q, self._toes[side])),
            v=_vec(found.v),
            contact=found.contact,
            stage=found.stage,
            sigma=found.sigma,
            age=found.age,
        )

    def _message(self, stream: str, t: int, now: int, body: Any) -> Message:
        seq = self._seq.get(stream, 0)
        self._seq[stream] = seq + 1
        message = Message(self._user, stream, SOURCE, self._sid, seq, t, now, True, body)
        if self._sink is not None:
            self._sink(message)
        return message


def _vec(v: Array) -> tuple[float, float, float]:
    x, y, z = v.tolist()
    return x, y, z


def _quat(q: Array) -> tuple[float, float, float, float]:
    x, y, z, w = q.tolist()
    return x, y, z, w


def _pose(p: Array, q: Array) -> Pose:
    return Pose(p=_vec(p), q=_quat(q))
