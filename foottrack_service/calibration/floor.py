"""``calibrate/floor``: the soles of a person who stands still are on the floor."""

from __future__ import annotations

from collections import deque

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.control import Code
from foottrack_protocol.messages import FloorCalibration, FloorValues, HeadPose, MountValues, Side
from foottrack_service import rotations as rot
from foottrack_service.calibration.flow import Flow, Progress, Refused, not_still
from foottrack_service.calibration.sight import Sight
from foottrack_service.calibration.stillness import STILL_S, StillHead
from foottrack_service.config import Settings
from foottrack_service.fusion.foot_filter_optical import implausible
from foottrack_service.rotations import Array

_FIRST = "Stand still, both feet flat on the floor, and look down at your feet."
LEAST_FIXES = 10
"""Of a foot, while the head is still."""
MOST_SPREAD = 0.012
"""m: standard deviation of a tag's place, its worst axis, while its foot stands."""
MOST_APART = 0.03
"""m: both soles are on one floor."""
EYES_ABOVE_FLOOR = (0.5, 2.3)
"""m."""
_KEPT_S = 1.0


class FloorFlow(Flow):
    """Watches head and tags until the head is still over feet that stand and agree.

    Tags, not fused feet: fusion holds a standing sole on the floor that it knows, which is what is in question.
    """

    streams = ("head/pose", "marker/")

    def __init__(self, settings: Settings, mount: MountValues | None = None) -> None:
        """``mount`` is the correction of the camera's mount that fusion applies."""
        super().__init__()
        self._settings = settings
        known = mount is not None and mount.base == settings.camera.mount_hash
        self._mount = (np.array(mount.p), np.array(mount.q)) if mount is not None and known else None
        self._head, self._sight = StillHead(), Sight()
        self._soles: dict[Side, deque[tuple[int, Array]]] = {"left": deque(), "right": deque()}
        self._problem = ""
        self._uneven = False
        self._seen = False
        self.progress = Progress(0.0, _FIRST)

    def _take(self, message: Message, now: int) -> None:
        for side, fix in self._sight.take(message):
            if implausible(fix) is None:
                p = fix.p
                if self._mount is not None:
                    p = self._mount[0] + rot.rotate(self._mount[1], p)
                self._seen = True
                self._soles[side].append((fix.t, fix.head.p + rot.rotate(fix.head.q, p)))
        if isinstance(message.data, HeadPose):
            self._head.add(message.t, np.array(message.data.p), np.array(message.data.q))
            self._try(message.t)

    def _on_untracked(self) -> None:
        self._head.reset()
        self.progress = Progress(0.0, _FIRST)

    def _try(self, t: int) -> None:
        since = self._head.since
        if since is None:
            self._problem = self._head.problem
            if self._head.sd is not None:
                self.progress = Progress(0.0, "Keep your head still.")
            return
        heights: dict[Side, float] = {}
        self._uneven = False
        for side, seen in self._soles.items():
            while seen and t - seen[0][0] > _KEPT_S * 1e9:
                seen.popleft()
            tags = np.array([p for stamp, p in seen if stamp >= since])
            if len(tags) < LEAST_FIXES:
                continue
            spread = float(np.std(tags, axis=0).max())
            if spread > MOST_SPREAD:
                self._problem = f"the {side} foot moved ({1000.0 * spread:.0f} mm)"
                self.progress = Progress(0.5, "Keep your feet still.")
                return
            foot = self._settings.feet.of(side)
            heights[side] = float(np.median(tags[:, 1])) - foot.marker.p[1] - foot.ankle_height
        if not heights:
            self._problem = "the camera saw no tag for long enough"
            self.progress = Progress(0.3, "Look down at your feet.")
            return
        apart = max(heights.values()) - min(heights.values())
        if apart > MOST_APART:
            self._uneven = True
            self._problem = f"one sole is {1000.0 * apart:.0f} mm above the other"
            self.progress = Progress(0.7, "Put both feet flat on the floor.")
            return
        self._finish(sum(heights.values()) / len(heights))

    def _finish(self, height: float) -> None:
        places, _ = self._head.poses(STILL_S)
        eyes = float(places[:, 1].mean()) - height
        least, most = EYES_ABOVE_FLOOR
        if not least < eyes < most:
            raise Refused(
                Code.FAILED,
                f"the headset would be {eyes:.2f} m above the floor: check [camera] mount and the tags' sizes",
            )
        self.found = FloorCalibration(values=FloorValues(height=height))
        self.progress = Progress(1.0, f"The floor is at {1000.0 * height:+.0f} mm.")

    def _too_late(self) -> Refused:
        if not self._seen:
            return Refused(
                Code.UNAVAILABLE, "no camera saw a tag on a foot: does the camera run? Look down at your feet"
            )
        if self._uneven:
            return Refused(Code.FAILED, f"{self._problem}: stand with both feet flat, and check [feet] marker")
        return not_still(self._problem, self.ready_to_wait_s)
