"""Our filter of one foot: its IMU with the fixes that correct it, and pictures alone where there is no IMU.

The fixes go to the inertial one while the IMU lives, else to the pictures' one, and so does the question where the
foot is.
"""

from __future__ import annotations

import logging
import math

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.compiled import is_compiled
from foottrack_service.config import CameraSettings, FootSettings, Placement
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.foot_filter_sample import take_sample
from foottrack_service.fusion.interface import (
    FootEstimate,
    HeadSample,
    ImuSample,
    Kind,
    Moves,
    OpticalFix,
    Target,
    Verdict,
    Whereabouts,
)
from foottrack_service.fusion.ladder import BALL_68_OF_ONE_AXIS, Ladder
from foottrack_service.fusion.mount_calibration import MountCalibrator
from foottrack_service.fusion.pictures_only import PicturesOnlyFilter
from foottrack_service.rotations import IDENTITY, Array

SYSTEMATIC, WITH_FLOOR = 0.002, 0.0014
"""m per axis: what no amount of agreeing fixes takes away (lens, depth scale, head pose, where the tag is glued); and
what is left of it where the floor has had its say in the depth scale."""
SEEN_S = 0.3
"""A fix accepted so recently shows that its foot is still tracked by its own."""

_log = logging.getLogger(__name__)


class ErrorStateFilter:
    """One foot (see interface.FootFilter)."""

    waits_for_head = True

    def __init__(self, foot: FootSettings, side: Side, *, floor: bool = True) -> None:
        self._inertial = InertialFilter(foot, side, floor=floor)
        self._pictures = PicturesOnlyFilter(foot)
        self._ladder = Ladder()
        self._device_q: Array | None = None

    @property
    def standing(self) -> bool:
        """Whether the whole foot stood still when the newest measurement was made."""
        # The pictures' filter knows nothing while the IMU lives.
        return self._inertial.standing if self._pictures.newest is None else self._pictures.contact

    def on_imu(self, sample: ImuSample) -> bool:
        """Take a sample, in order of arrival. False: it is left out (see InertialFilter)."""
        taken = self._inertial.on_imu(sample)
        if taken:
            self._ladder.saw_imu(sample.t)
            self._device_q = sample.q
        return taken

    def on_fix(self, fix: OpticalFix, now: int) -> Verdict:
        """Take an optical fix that arrives at ``now``, later than its own ``t``."""
        if fix.kind == "depth" and self._ladder.fix_within("marker", fix.t):
            self._inertial.learn_blob(fix)
            return Verdict.UNUSED
        if self._inertial.begun and self._ladder.imu_alive(now):
            self._pictures.lose()
            verdict = self._inertial.on_fix(fix)
        else:
            verdict = self._pictures.on_fix(fix)
        if verdict is Verdict.ACCEPTED:
            self._ladder.saw_fix(fix.kind, fix.t)
        return verdict

    def on_floor(self, height: float) -> None:
        """The floor is at this height in the stage, m."""
        self._inertial.set_floor(height)

    def on_imu_yaw(self, yaw: float) -> None:
        """The yaw of the device's own frame in the stage was calibrated, rad: counts until a fix is accepted."""
        inertial = self._inertial
        inertial.set_imu_yaw(yaw)
        if self._device_q is None or self._ladder.age(inertial.newest) is not None:
            return
        # So far the foot's first attitude was a guess: it turns on its spot.
        device = rot.multiply(inertial.state[0][6:10], rot.conjugate(self._device_q))
        turn = rot.from_yaw(yaw - rot.yaw_of(device))
        ankle = inertial.predicted(inertial.newest)[0]
        inertial.move(ankle - rot.rotate(turn, ankle), turn)

    def on_imu_placement(self, placement: Placement) -> None:
        """The sensor's place on the shoe was calibrated."""
        self._inertial.place(placement)

    def on_recentred(self, p: Array | None, q: Array | None) -> None:
        """The stage moved by the rigid motion old to new, or by an unknown one (None: re-acquire)."""
        if p is None or q is None:
            self._inertial.lose()
            self._pictures.lose()
        else:
            self._inertial.move(p, q)
            self._pictures.move(p, q)

    def on_head_lost(self) -> None:
        """The headset does not know where it is: what stood need not be where it was in the stage."""
        self._inertial.doubt.forget()

    def beside(self, other: Whereabouts, moves: Moves) -> None:
        """Two feet are never in one place, and seldom move alike."""
        self._inertial.other = self._pictures.other = other
        self._inertial.other_moves = moves

    def moves(self, frm: int, to: int) -> bool | None:
        """Whether the IMU shows the foot swinging, or standing, between two instants, ns; None: neither."""
        return self._inertial.moves(frm, to)

    def target(self, kind: Kind, t: int) -> Target | None:
        """Where fixes of ``kind`` are expected at ``t``, ns; None while that is not well known."""
        source = self._inertial if self._inertial.begun and self._ladder.imu_alive(t) else self._pictures
        found = source.target(kind, t)
        return None if found is None else Target(*found, self._ladder.fix_within(kind, t, SEEN_S))

    def estimate(self, t: int) -> FootEstimate | None:
        """The foot predicted to ``t``; None before anything is known."""
        inertial, pictures = self._inertial, self._pictures
        seen = pictures.newest is not None
        if not inertial.begun and not seen:
            return None
        source: InertialFilter | PicturesOnlyFilter = inertial
        if seen and not (inertial.begun and self._ladder.imu_alive(t)):
            source = pictures
        p, q, v, sd = source.predicted(t)
        with_floor = source is inertial and inertial.knows_range
        sigma = BALL_68_OF_ONE_AXIS * math.hypot(sd, WITH_FLOOR if with_floor else SYSTEMATIC)
        return FootEstimate(t, p, q, v, source.contact, self._ladder.stage(t, sigma), sigma, self._ladder.age(t))


def warm_up() -> None:
    """Compile the kernels, or read them from the cache, before the first sample needs them, and say so."""
    if not is_compiled(take_sample):
        _log.info("compiling the foot filter for this machine: about half a minute, this once")
    trial, mount = ErrorStateFilter(FootSettings(), "left"), MountCalibrator(CameraSettings().mount)
    step = 5_000_000
    # The second start comes after a silence.
    for i in (*range(40), *range(300, 340)):
        trial.on_imu(ImuSample(i * step, np.array([0.0, 9.80665, 0.0]), np.zeros(3), None))
        head = HeadSample(i * step, np.array([0.0, 1.6, 0.0]), IDENTITY)
        p, q = np.array([-0.1, -1.55, -0.15]), np.array(FootSettings().marker.q)
        fix = OpticalFix(head.t, "marker", p, q, None, 1e-6 * np.eye(3), 1.0, 50.0, head, head)
        trial.on_fix(fix, head.t)
        mount.add("left", fix, standing=True)
    trial.estimate(340 * step)
    _log.debug("the foot filter is ready")
