"""The camera's mount, calibrated in the background: what fusion publishes of it, and when it says that it slipped."""

from __future__ import annotations

import logging
import math

from foottrack_protocol.messages import MountCalibration, MountValues, Side
from foottrack_service.fusion.interface import OpticalFix
from foottrack_service.fusion.mount_calibration import MountCalibrator

PERIOD_S = 5.0
"""Between two publications."""
SPACING_S = 0.03
"""Between two fixes of a foot that are looked at: neighbours say the same, and each costs 60 us."""

_log = logging.getLogger(__name__)


class MountWatch:
    """Collects fixes of standing feet; its result is for the mount that is configured, named by ``base``."""

    def __init__(self, base: str) -> None:
        self._base = base
        self._due: int | None = None
        self.restart()

    def restart(self) -> None:
        """Somebody knows better: what was seen so far may have been with another mount."""
        self._calibrator = MountCalibrator()
        self._taken: dict[Side, int] = {}
        self._slips = 0

    def add(self, side: Side, fix: OpticalFix, standing: bool) -> None:
        """A fix that the filter believed, as the *configured* mount gave it, and whether its foot stands."""
        last = self._taken.get(side)
        if last is not None and 0.0 <= (fix.t - last) * 1e-9 < SPACING_S:
            return
        self._taken[side] = fix.t
        self._calibrator.add(side, fix, standing)
        if self._calibrator.slips > self._slips:
            self._slips = self._calibrator.slips
            _log.warning(
                "the camera has moved on the headset: feet will be off until it is calibrated anew, which goes on in "
                "the background; look at your feet for a while, or run: foottrack calibrate mount"
            )

    def recentred(self) -> None:
        """The stage moved."""
        self._calibrator.recentred()

    def found(self, now: int) -> MountCalibration | None:
        """The correction, every 5 s once feet are better off with it; ``now`` in ns."""
        if self._due is not None and 0 <= self._due - now <= PERIOD_S * 1e9:
            return None
        self._due = now + round(PERIOD_S * 1e9)
        estimate = self._calibrator.estimate()
        if estimate is None or not estimate.useful:
            return None
        p, q = estimate.p.tolist(), estimate.q.tolist()
        if not math.isfinite(sum(p) + sum(q)):
            self.restart()
            return None
        return MountCalibration(
            values=MountValues(
                p=(p[0], p[1], p[2]),
                q=(q[0], q[1], q[2], q[3]),
                sigma_p=estimate.sigma_p,
                sigma_q=estimate.sigma_q,
                base=self._base,
            )
        )
