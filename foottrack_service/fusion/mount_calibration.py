"""The camera's mount in use: what it lacks by all that was seen, and whether what was seen lately says otherwise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from foottrack_protocol.messages import MountValues, Side
from foottrack_service import rotations as rot
from foottrack_service.config import Placement
from foottrack_service.fusion.foot_filter_optical import implausible
from foottrack_service.fusion.interface import OpticalFix
from foottrack_service.fusion.mount_filter import MountFilter
from foottrack_service.rotations import Array

LEAST_PICTURES = 30
"""Before which nothing is said."""
RECENT_S = 8.0
"""What was seen lately: of so long at least, and of twice as long at most."""
CHECK_S = 1.0
SLIP_CHI_SQUARE = 28.0
"""6 degrees of freedom, 99.99 %; more where pictures are noisier than they claim: feet on soft soles."""
SLIP_CHECKS = 2
"""So many in a row must say so."""
SAME_SLIP_S = 30.0
"""What is found out of a slip so soon after it is no other one."""
SLIP_TURN, SLIP_SHIFT = math.radians(0.2), 0.003
"""rad, m: a mount that has moved by less has not slipped."""
SLIP_UNSURE = 0.3
"""Of a slip: what was seen lately may be in part from before it."""
GOOD_TURN, GOOD_SHIFT = math.radians(0.07), 0.0014
"""rad, m SD of the least known axis: what a calibration on request must reach; all axes together: 0.1 deg and 2 mm."""
USEFUL_FOOT, SURE_FOOT = 0.003, 0.001
"""m per axis SD where the feet are: of a correction that they need, and of any."""
NEEDED_SIGMAS = 3.0
"""A correction that moves the feet by less may be an error alone: a mount that was right would get worse."""


@dataclass(frozen=True, slots=True)
class MountEstimate:
    """A correction of the mount, head frame: apply ``q``, then add ``p``."""

    p: Array
    """m."""
    q: Array
    sigma_p: float
    """m, of the least known axis."""
    sigma_q: float
    """rad, of the least known axis."""
    sigma_foot: float
    """m per axis: how unsure the correction is where the feet were seen. Turn and shift make up for each other there,
    so this is known long before either."""
    foot: float
    """m: how far it moves what is seen where the feet were."""

    @property
    def good(self) -> bool:
        """Whether the mount itself is known."""
        return self.sigma_p <= GOOD_SHIFT and self.sigma_q <= GOOD_TURN

    @property
    def useful(self) -> bool:
        """Whether feet are better off with it."""
        needed = self.foot > NEEDED_SIGMAS * math.sqrt(3.0) * self.sigma_foot
        return self.sigma_foot <= (USEFUL_FOOT if needed else SURE_FOOT)


class MountCalibrator:
    """Takes fixes of standing feet as the *configured* mount gave them, and tells what that mount lacks."""

    def __init__(self, camera: Placement, known: MountValues | None = None) -> None:
        """``camera``: the configured mount. ``known``: what an earlier use found; the headset may have been taken off
        since."""
        self._all = MountFilter(camera, known)
        self._lately = [_Lately(self._all), _Lately(self._all)]
        self._renewed: int | None = None
        self._checked = 0
        self._slipping = 0
        self._slipped_at: int | None = None
        self.slips = 0
        """How often the mount was seen to have moved."""

    def add(self, side: Side, fix: OpticalFix, standing: bool) -> None:
        """A fix of one foot, in order, and whether that foot stands flat. Other kinds than "marker" are left out."""
        if fix.kind != "marker" or implausible(fix) is not None:
            return
        if standing:
            self._take(side, fix)
        else:
            self._end(side)

    def recentred(self) -> None:
        """The stage moved: targets stand elsewhere in it."""
        self._end("left")
        self._end("right")

    def estimate(self) -> MountEstimate | None:
        """What is known so far, None before anything is."""
        if self._all.pictures < LEAST_PICTURES:
            return None
        sd = np.sqrt(np.diag(self._all.covariance))
        return MountEstimate(
            self._all.shift,
            self._all.turn.copy(),
            float(sd[3:].max()),
            float(sd[:3].max()),
            math.sqrt(float(np.trace(self._all.foot_covariance)) / 3.0),
            float(np.linalg.norm(self._all.foot_moved)),
        )

    def _take(self, side: Side, fix: OpticalFix) -> None:
        for each in self._filters():
            each.add(side, fix)
        if self._renewed is None or abs(fix.t - self._renewed) > RECENT_S * 1e9:
            self._renewed = fix.t
            self._lately = [self._lately[1], _Lately(self._all)]
        if abs(fix.t - self._checked) > CHECK_S * 1e9:
            self._checked = fix.t
            self._notice_a_slip(fix.t)

    def _notice_a_slip(self, t: int) -> None:
        lately = self._lately[0]
        slip = lately.slip()
        self._slipping = 0 if slip is None else self._slipping + 1
        if slip is not None and self._slipping >= SLIP_CHECKS:
            self.slips += self._slipped_at is None or abs(t - self._slipped_at) > SAME_SLIP_S * 1e9
            self._slipping, self._slipped_at = 0, t
            self._all = lately.filter
            turn, shift = (SLIP_UNSURE * float(np.linalg.norm(part)) for part in (slip[:3], slip[3:]))
            self._all.widen(turn, shift)
            self._lately = [_Lately(self._all), _Lately(self._all)]

    def _end(self, side: Side) -> None:
        for each in self._filters():
            each.end(side)

    def _filters(self) -> tuple[MountFilter, ...]:
        return self._all, self._lately[0].filter, self._lately[1].filter


class _Lately:
    """What was seen from now on, and what was known before."""

    def __init__(self, before: MountFilter) -> None:
        self.filter = before.anew()
        self._turn, self._shift, self._covariance = before.turn.copy(), before.shift, before.covariance

    def slip(self) -> Array | None:
        """How the mount has moved, turn (rad) and shift (m), shape (6,); None: not for sure."""
        if self.filter.pictures < LEAST_PICTURES:
            return None
        turn = rot.to_rotation_vector(rot.multiply(self.filter.turn, rot.conjugate(self._turn)))
        gap = np.concatenate([turn, self.filter.shift - self._shift])
        covariance = self._covariance + self.filter.covariance
        if float(gap @ np.linalg.solve(covariance, gap)) < SLIP_CHI_SQUARE * math.sqrt(self.filter.noise):
            return None
        least = np.array([SLIP_TURN] * 3 + [SLIP_SHIFT] * 3)
        # What a slip of the least size is likely to have been, given what is seen of it.
        likely = least**2 * np.linalg.solve(np.diag(least**2) + covariance, gap)
        return gap if float(np.sum(np.square(likely / least))) > 1.0 else None
