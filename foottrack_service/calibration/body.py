"""``calibrate/body``: the measures of a person who stands upright and looks ahead for 3 s, and then nods, if so."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.control import Code
from foottrack_protocol.messages import BodyCalibration, BodyPose, BodyValues, HeadPose
from foottrack_service import rotations as rot
from foottrack_service.body.facing import head_yaw
from foottrack_service.body.posture import HIPS_BEFORE_ANKLES, REACH
from foottrack_service.body.skeleton import EYE_HEIGHT, EYES_ABOVE_NECK, EYES_BEFORE_NECK, Skeleton
from foottrack_service.calibration.flow import Flow, Progress, Refused, not_still
from foottrack_service.calibration.nod import LEAST_NOD, Neck, neck_of, nods_of
from foottrack_service.calibration.stillness import StillHead
from foottrack_service.config import BodySettings, Settings
from foottrack_service.rotations import Array

_FIRST = "Stand upright and still, feet together, and look straight ahead."
UPRIGHT_S = 3.0
NOD_S = 6.0
"""For a look down and up again. Who does not nod has the neck that people have."""
_NOD = "Now look down at your feet, and up again."
_RAISED = math.radians(10.0)
"""A head that comes back so near to where it was has nodded."""
_USUAL = Neck(EYES_ABOVE_NECK, EYES_BEFORE_NECK)
MOST_NOD = math.radians(25.0)
"""A head that nods further is not level, and its eyes are not at their height."""
MOST_OFF = 0.07
"""m: how far the eyes' height may be off from that of a person of the height that was given."""
HEIGHTS = (0.8, 2.4)
"""m: what can be a person's."""
HIP_BACKS = (0.0, 0.25)
"""m: what can be; beyond it the feet were not under the hips."""
MOST_SIGMA = 0.05
"""m: a foot that is less sure says nothing of where the hips are."""


class BodyFlow(Flow):
    """Watches the head until it has been still and level for 3 s; feet that are known tell where the hips are."""

    streams = ("head/pose", "pose/body")

    def __init__(self, settings: Settings, height: float | None = None, floor: float = 0.0) -> None:
        """``height``: of the person, m, if known. ``floor``: the floor's height in the stage, m."""
        super().__init__()
        self._settings, self._height, self._floor = settings, height, floor
        self._head = StillHead()
        self._level_since: int | None = None
        self._nods = self._nodded = False
        self._feet: deque[tuple[int, Array]] = deque()
        self._stood: tuple[Array, Array] | None = None
        """Places and turns of the head while it stood, once it has."""
        self._nod: list[tuple[float, Array, Array]] = []
        self.progress = Progress(0.0, _FIRST)

    def _take(self, message: Message, now: int) -> None:
        if isinstance(message.data, BodyPose):
            self._on_feet(message.t, message.data)
        elif isinstance(message.data, HeadPose):
            q = np.array(message.data.q)
            self._head.add(message.t, np.array(message.data.p), q)
            gaze = rot.rotate(q, [0.0, 0.0, -1.0])
            self._nods = abs(math.asin(float(np.clip(gaze[1], -1.0, 1.0)))) > MOST_NOD
            if self._nods:
                self._level_since = None
            elif self._level_since is None:
                self._level_since = message.t
            if self._stood is None:
                self._try(message.t)
            else:
                self._watch_nod(message.t * 1e-9, np.array(message.data.p), q)

    def tick(self, now: int) -> None:
        """The time. Who has stood has measures, whether or not a nod was seen."""
        try:
            super().tick(now)
        except Refused:
            if self._stood is None:
                raise
            self._finish(_USUAL)

    def _on_untracked(self) -> None:
        self._head.reset()
        if self._stood is None:
            self.progress = Progress(0.0, _FIRST)

    def _on_feet(self, t: int, body: BodyPose) -> None:
        feet = (body.left, body.right)
        if all(f is not None and f.contact and f.age is not None and f.sigma < MOST_SIGMA for f in feet):
            self._feet.append((t, np.mean([f.ankle.p for f in feet if f is not None], axis=0)))
        while self._feet and t - self._feet[0][0] > UPRIGHT_S * 1e9:
            self._feet.popleft()

    def _try(self, t: int) -> None:
        if self._level_since is None:
            self.progress = Progress(0.0, "Look straight ahead.")
            return
        if self._head.since is None:
            if self._head.sd is not None:
                self.progress = Progress(0.0, "Stand still.")
            return
        stood = (t - max(self._level_since, self._head.since)) * 1e-9
        if stood < UPRIGHT_S:
            self.progress = Progress(0.5 * stood / UPRIGHT_S, "Good. Stay like that.")
            return
        self._stood = self._head.poses(UPRIGHT_S)
        self._values(_USUAL)
        self.progress = Progress(0.6, _NOD)

    def _watch_nod(self, t: float, p: Array, q: Array) -> None:
        assert self._stood is not None
        self._nod.append((t, p, q))
        looks = nods_of(np.array([self._stood[1][-1], q]))
        self._nodded = self._nodded or looks[0] - looks[1] > LEAST_NOD
        if (self._nodded and looks[0] - looks[1] < _RAISED) or t - self._nod[0][0] > NOD_S:
            times, places, turns = (np.array(column) for column in zip(*self._nod, strict=True))
            self._finish(neck_of(times, places, turns) or _USUAL)

    def _finish(self, neck: Neck) -> None:
        self.found = BodyCalibration(values=self._values(neck))
        self.progress = Progress(1.0, f"You are {self.found.values.height:.2f} m tall.")

    def _values(self, neck: Neck) -> BodyValues:
        assert self._stood is not None
        places, turns = self._stood
        # What the eyes' place would be if the head were quite level.
        yaw = rot.from_yaw([head_yaw(q) for q in turns])
        necks = places + rot.rotate(turns, [0.0, -neck.down, neck.back])
        level = (necks + rot.rotate(yaw, [0.0, neck.down, -neck.back])).mean(axis=0)
        eyes = float(level[1]) - self._floor
        height = self._height or eyes / EYE_HEIGHT
        expected = EYE_HEIGHT * height
        if self._height is not None and abs(eyes - expected) > MOST_OFF:
            raise Refused(
                Code.FAILED,
                f"the headset is {eyes:.2f} m above the floor, that of a person of {height:.2f} m is at about "
                f"{expected:.2f} m: calibrate the floor first, stand upright, and check the height",
            )
        least, most = HEIGHTS
        if not least < height < most:
            raise Refused(
                Code.FAILED,
                f"the headset is {eyes:.2f} m above the floor, no standing person's: calibrate the floor first",
            )
        body = Skeleton.of(BodySettings(height=height))
        ankle = 0.5 * (self._settings.feet.left.ankle_height + self._settings.feet.right.ankle_height)
        measured = neck is not _USUAL
        return BodyValues(
            height=height,
            thigh=body.thigh,
            shank=body.shank,
            torso=eyes - ankle - REACH * (body.thigh + body.shank),
            hip_width=body.hip_width,
            hip_back=self._hip_back(level, rot.rotate(yaw[-1], [0.0, 0.0, -1.0]), body.hip_back),
            neck_down=neck.down if measured else None,
            neck_back=neck.back if measured else None,
        )

    def _hip_back(self, eyes: Array, forward: Array, otherwise: float) -> float:
        if not self._feet:
            return otherwise
        feet = np.mean([p for _, p in self._feet], axis=0)
        found = float(np.dot(eyes - feet, forward)) - HIPS_BEFORE_ANKLES
        least, most = HIP_BACKS
        return found if least <= found <= most else otherwise

    def _too_late(self) -> Refused:
        if self._nods:
            return not_still("the head was not level: look straight ahead", self.ready_to_wait_s)
        return not_still(self._head.problem, self.ready_to_wait_s)
