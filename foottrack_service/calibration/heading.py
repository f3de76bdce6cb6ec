"""``calibrate/heading``: forward, and each IMU's own yaw, from a look ahead and one step forward."""

from __future__ import annotations

import math

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.control import Code
from foottrack_protocol.messages import HeadingCalibration, HeadingValues, HeadPose, Imu, PerSideYaw, Side
from foottrack_service import rotations as rot
from foottrack_service.body.facing import foot_yaw, head_yaw
from foottrack_service.calibration.flow import Flow, Progress, Refused, not_still, side_of
from foottrack_service.calibration.step import Sample, displacement, resting
from foottrack_service.calibration.stillness import STILL_S, StillHead
from foottrack_service.config import Settings
from foottrack_service.rotations import Array

LEAST_STEP = 0.25
"""m, of the head."""
LEAST_FOOT_STEP = 0.15
"""m, of a foot, by its IMU."""
MOST_ASIDE = math.radians(25.0)
"""Between the look and the step."""
MOST_TURN = math.radians(45.0)
"""Of the look: more, and the person turned on the spot, which takes the eyes as far as a step."""
MOST_TWIST = math.radians(40.0)
"""Between the way a foot went and the way it points: more is another mounting than the configured one."""
_FIRST, _NEXT = "Stand still, feet parallel, and look straight ahead.", "Now take one step forward, and stand still."
_KEPT_S = 12.0


class HeadingFlow(Flow):
    """Watches the head until it is still, has gone a step, and is still again; IMUs with an attitude of their own.

    Look and step say what is forward. How each device's frame is turned in the stage comes from two sources that err
    by some 4 deg each, in the middle: where the foot went in it (drift), and where the foot points in it (toes out).
    An IMU without an attitude of its own has no such frame, and gets no yaw.
    """

    streams = ("head/pose", "imu/")

    def __init__(self, settings: Settings) -> None:
        super().__init__()
        self._settings = settings
        self._head = StillHead()
        self._samples: dict[Side, list[Sample]] = {}
        self._from: Array | None = None
        self._looked = 0.0
        self._stood: dict[Side, float] = {}
        self.progress = Progress(0.0, _FIRST)

    def _take(self, message: Message, now: int) -> None:
        body, side = message.data, side_of(message.stream)
        if isinstance(body, Imu) and side is not None:
            if body.q is not None:
                self._keep(side, Sample(message.t * 1e-9, body.acc, body.q))
        elif isinstance(body, HeadPose):
            self._head.add(message.t, np.array(body.p), np.array(body.q))
            if self._head.still_s >= STILL_S:
                self._still()
            elif self._from is None:
                self.progress = Progress(0.0, _FIRST)

    def _on_untracked(self) -> None:
        self._head.reset()

    def _keep(self, side: Side, sample: Sample) -> None:
        samples = self._samples.setdefault(side, [])
        if samples and sample.t <= samples[-1].t:
            return
        samples.append(sample)
        if sample.t - samples[0].t > 2.0 * _KEPT_S:
            del samples[: sum(s.t < sample.t - _KEPT_S for s in samples)]

    def _still(self) -> None:
        places, turns = self._head.poses(STILL_S)
        place, looks = places.mean(axis=0), _mean([head_yaw(q) for q in turns])
        if self._from is not None and abs(_wrapped(looks - self._looked)) > MOST_TURN:
            self._from = None
        if self._from is None or math.hypot(*(place - self._from)[[0, 2]]) < LEAST_STEP:
            if self._from is None:
                for side in list(self._samples):
                    self._samples[side] = [s for s in self._samples[side] if s.t >= self._samples[side][-1].t - STILL_S]
            self._from = place
            self._looked = looks
            self.progress = Progress(0.5, _NEXT)
        elif all(self._has_settled(samples) for samples in self._samples.values()):
            self._finish(place - self._from)

    def _has_settled(self, samples: list[Sample]) -> bool:
        recent = [s for s in samples if s.t >= samples[-1].t - 0.3]
        return bool(resting(recent).all())

    def _finish(self, way: Array) -> None:
        went = math.atan2(-way[0], -way[2])
        aside = _wrapped(went - self._looked)
        if abs(aside) > MOST_ASIDE:
            where = f"{abs(math.degrees(aside)):.0f} degrees to the {'left' if aside > 0.0 else 'right'}"
            raise Refused(Code.FAILED, f"the step went {where} of where you looked: look straight ahead and step there")
        yaws = {side: self._imu_yaw(side, samples, went) for side, samples in self._samples.items()}
        yaw = _mean([self._looked, went])
        self.found = HeadingCalibration(
            values=HeadingValues(yaw=yaw, imu_yaw=PerSideYaw(left=yaws.get("left"), right=yaws.get("right")))
        )
        self.progress = Progress(1.0, f"Forward is {math.degrees(yaw):+.0f} degrees.")

    def _imu_yaw(self, side: Side, samples: list[Sample], went: float) -> float:
        way = displacement(samples)
        if math.hypot(way[0], way[2]) < LEAST_FOOT_STEP:
            raise Refused(Code.FAILED, f"the {side} foot did not step along: step forward with one, then the other")
        yaw = _wrapped(went - math.atan2(-way[0], -way[2]))
        mounted = rot.conjugate(self._settings.feet.of(side).imu.q)
        rests = resting(samples)
        pointed = [
            foot_yaw(rot.multiply(s.q, mounted).tolist()) for s, rest in zip(samples, rests, strict=True) if rest
        ]
        twist = _wrapped(_mean(pointed) + yaw - went)
        if abs(twist) > MOST_TWIST:
            raise Refused(
                Code.FAILED,
                f"the {side} foot points {abs(math.degrees(twist)):.0f} degrees away from where it stepped: put the "
                f"feet parallel, and check [feet.{side}] imu and which IMU is on which foot",
            )
        return _wrapped(yaw - 0.5 * twist)

    def _too_late(self) -> Refused:
        if self._from is None:
            return not_still(self._head.problem, self.ready_to_wait_s)
        if self._head.still_s >= STILL_S and self._moving():
            return not_still("a foot did not stand still after the step", self.ready_to_wait_s)
        return Refused(Code.FAILED, f"no step of at least {LEAST_STEP:g} m and a stand after it was seen")

    def _moving(self) -> bool:
        return not all(self._has_settled(samples) for samples in self._samples.values())


def _mean(yaws: list[float]) -> float:
    return math.atan2(sum(map(math.sin, yaws)), sum(map(math.cos, yaws)))


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
