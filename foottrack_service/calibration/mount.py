"""``calibrate/mount``: where the camera sits on the headset, from feet that stand while the head moves."""

from __future__ import annotations

import math

from foottrack_protocol import Message
from foottrack_protocol.control import Code
from foottrack_protocol.messages import BodyPose, MountCalibration, MountValues, Side
from foottrack_service.calibration.flow import Flow, Progress, Refused
from foottrack_service.calibration.sight import Sight
from foottrack_service.config import Settings
from foottrack_service.fusion.mount_calibration import GOOD_SHIFT, GOOD_TURN, MountCalibrator, MountEstimate

LEAST_S = 8.0
"""A sway alone tells a mount in no time and badly: so long the person looks around at least."""
_DO = "Keep your feet where they are. Look down at them, and turn, tilt and shift your head slowly."


class MountFlow(Flow):
    """Feeds the fixes of standing feet, as the configured mount gave them, to fusion's own estimate."""

    streams = ("head/pose", "marker/", "pose/body")
    ready_to_wait_s = 50.0

    def __init__(self, settings: Settings) -> None:
        super().__init__()
        self._base = settings.camera.mount_hash
        self._sight, self._calibrator = Sight(), MountCalibrator(settings.camera.mount)
        self._stands: dict[Side, bool] = {"left": True, "right": True}
        self._fixes = self._standing = 0
        self.progress = Progress(0.0, _DO)

    def _take(self, message: Message, now: int) -> None:
        if isinstance(message.data, BodyPose):
            for side, foot in (("left", message.data.left), ("right", message.data.right)):
                self._stands["left" if side == "left" else "right"] = foot is None or foot.contact
            return
        for side, fix in self._sight.take(message):
            self._fixes += 1
            self._standing += self._stands[side]
            self._calibrator.add(side, fix, self._stands[side])

    def tick(self, now: int) -> None:
        """As every flow; and looks whether the estimate is good enough."""
        estimate = self._calibrator.estimate()
        waited = 0.0 if self._began is None else (now - self._began) * 1e-9
        if self.found is None and estimate is not None:
            sharp = min(1.0, GOOD_SHIFT / estimate.sigma_p, GOOD_TURN / estimate.sigma_q)
            self.progress = Progress(min(sharp, waited / LEAST_S, 0.99), _DO)
            if estimate.good and waited >= LEAST_S:
                self._finish(estimate)
        super().tick(now)

    def _finish(self, estimate: MountEstimate) -> None:
        p, q = estimate.p.tolist(), estimate.q.tolist()
        self.found = MountCalibration(
            values=MountValues(
                p=(p[0], p[1], p[2]),
                q=(q[0], q[1], q[2], q[3]),
                sigma_p=estimate.sigma_p,
                sigma_q=estimate.sigma_q,
                base=self._base,
            )
        )
        turn = 2.0 * math.degrees(math.acos(min(1.0, abs(q[3]))))
        self.progress = Progress(1.0, f"The camera was off by {1000.0 * math.hypot(*p):.0f} mm and {turn:.1f} degrees.")

    def _too_late(self) -> Refused:
        if self._fixes == 0:
            return Refused(Code.UNAVAILABLE, "no camera saw a tag on a foot: does it run? Look down at your feet")
        if self._standing < 0.5 * self._fixes:
            return Refused(Code.NOT_STILL, "the feet moved: leave them where they are, and move the head only")
        estimate = self._calibrator.estimate()
        known = (
            ""
            if estimate is None
            else (f" (known to {1000.0 * estimate.sigma_p:.1f} mm and {math.degrees(estimate.sigma_q):.2f} degrees)")
        )
        return Refused(
            Code.FAILED, f"the head's movements do not tell the mount yet{known}: move it further, and slowly"
        )
