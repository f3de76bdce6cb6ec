"""The camera's mount, calibrated in the background: what fusion publishes of it, and when it says that it slipped."""

from __future__ import annotations

import logging
import math
from collections import deque

from foottrack_protocol.messages import FilterHealth, MountCalibration, MountValues, Side
from foottrack_service.config import CameraSettings
from foottrack_service.fusion.interface import OpticalFix
from foottrack_service.fusion.mount_calibration import MountCalibrator

PERIOD_S = 5.0
"""Between two publications."""
HELD_S = 0.5
"""So long a fix waits, and so long after several that were not believed none counts."""
SEVERAL, TOGETHER_S = 4, 0.3
"""Single false tags say nothing of the others; this many in so short a time do."""
KEPT = 128
"""So many of our own results are known again when they come back."""

_log = logging.getLogger(__name__)


class MountWatch:
    """Collects fixes of standing feet; its result is for the mount that is configured."""

    def __init__(self, camera: CameraSettings) -> None:
        self._camera, self._base = camera.mount, camera.mount_hash
        self._due: int | None = None
        self._said: deque[MountValues] = deque(maxlen=KEPT)
        self.slips = self._found_since = 0
        self.restart()

    def restart(self, known: MountValues | None = None) -> None:
        """Somebody knows better: what was seen so far may have been with another mount."""
        if known is not None and known.base != self._base:
            return  # of a mount that is not configured
        self._calibrator = MountCalibrator(self._camera, known)
        self._said.clear()
        self._held: deque[tuple[Side, OpticalFix, bool]] = deque(maxlen=256)
        self._doubts: deque[int] = deque(maxlen=SEVERAL)
        self._doubted: int | None = None
        self._slips = 0

    def add(self, side: Side, fix: OpticalFix, standing: bool) -> None:
        """A fix that the filter believed, as the *configured* mount gave it, and whether its foot stands.

        It counts HELD_S later: by then its neighbours have shown whether the sensors were well.
        """
        if self._doubted is None or abs(fix.t - self._doubted) > HELD_S * 1e9:
            self._held.append((side, fix, standing))
        while self._held and abs(fix.t - self._held[0][1].t) > HELD_S * 1e9:
            self._calibrator.add(*self._held.popleft())
        if self._calibrator.slips > self._slips:
            self._slips = self._calibrator.slips
            self.slips, self._found_since = self.slips + 1, 0
            _log.warning(
                "the camera has moved on the headset: feet will be off until it is calibrated anew, which goes on in "
                "the background; look at your feet for a while, or run: foottrack calibrate mount"
            )

    def doubt(self, t: int) -> None:
        """A fix of ``t``, ns, was not believed. Where several are not, the others about then may be as wrong."""
        self._doubts.append(t)
        if len(self._doubts) == SEVERAL and abs(t - self._doubts[0]) <= TOGETHER_S * 1e9:
            self._held.clear()
            self._doubted = t

    def recentred(self) -> None:
        """The stage moved."""
        self._held.clear()
        self._calibrator.recentred()

    def said(self, values: MountValues) -> bool:
        """Whether this is our own result, which comes back as somebody has kept it."""
        return values in self._said

    @property
    def health(self) -> FilterHealth:
        """How often it was found since it last slipped, and how often it slipped."""
        slipped = {"slipped": self.slips} if self.slips else {}
        return FilterHealth(accepted={"found": self._found_since}, rejected=slipped)

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
        values = MountValues(
            p=(p[0], p[1], p[2]),
            q=(q[0], q[1], q[2], q[3]),
            sigma_p=estimate.sigma_p,
            sigma_q=estimate.sigma_q,
            base=self._base,
        )
        self._said.append(values)
        self._found_since += 1
        return MountCalibration(values=values)
