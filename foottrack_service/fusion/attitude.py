"""Attitude of a foot as the reference filter has it: the device's own orientation and a yaw offset that stays fixed.

A sensor without fusion on board gets its orientation from the imufusion library (S. Madgwick's revised AHRS).
"""

from __future__ import annotations

import imufusion
import numpy as np

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.config import Placement
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array

_Z_UP_TO_Y_UP = rot.from_axis_angle([1.0, 0.0, 0.0], -np.pi / 2)
_LONGEST_STEP_S = 0.1
"""A longer hole between samples is bridged by no integration: the accelerometer levels the AHRS again."""


class Attitude:
    """Sensor and foot against the stage. Until a tag or a calibration fixes the yaw, the toes point to -Z."""

    def __init__(self, placement: Placement) -> None:
        self._foot_to_sensor = rot.conjugate(placement.q)
        self._device: Array | None = None
        self._raw: _Ahrs | None = None
        self._yaw: float | None = None
        self._turn: Array = rot.IDENTITY
        """By the yaw."""
        self._fixed = False
        self._upright: Array = rot.IDENTITY
        """Foot to stage as tags show it, kept for a foot without an IMU: upright, yaw only."""
        self.sensor_to_stage: Array = rot.IDENTITY
        self.foot_to_stage: Array = rot.IDENTITY

    def update(self, sample: ImuSample) -> None:
        """Take the device's orientation, or compute one from its raw axes."""
        if sample.q is not None:
            self._device = sample.q
        elif sample.gyro is not None:
            if self._raw is None:
                self._raw = _Ahrs()
            self._device = self._raw.update(sample.t, sample.gyro, sample.acc)
        if self._device is None:
            return
        if self._yaw is None:
            self._set_yaw(-float(rot.yaw_of(self._foot_in_device())))
        self._compose()

    def see(self, solutions: list[Array]) -> None:
        """A tag showed the foot (foot to stage, one of the planar pose's solutions): fixes the yaw the first time."""
        if self._device is None:
            upright = [rot.twist_about_up(q) for q in solutions]
            self._upright = self.foot_to_stage = upright[0]
            return
        if self._fixed:
            return
        foot = self._foot_in_device()
        up = rot.unrotate(foot, [0.0, 1.0, 0.0])
        best = max(solutions, key=lambda q: float(rot.unrotate(q, [0.0, 1.0, 0.0]) @ up))
        self.fix_yaw(float(rot.yaw_of(best) - rot.yaw_of(foot)))

    def fix_yaw(self, yaw: float) -> None:
        """Yaw of the device's own frame in the stage, rad."""
        self._set_yaw(yaw)
        self._fixed = True
        self._compose()

    def place(self, placement: Placement) -> None:
        """The sensor sits elsewhere on the shoe than was configured."""
        self._foot_to_sensor = rot.conjugate(placement.q)
        self._compose()

    def turn(self, q: Array) -> None:
        """The stage was turned by q, old to new."""
        turn = float(rot.yaw_of(q))
        self._upright = rot.multiply(q, self._upright)
        if self._yaw is None:
            self.foot_to_stage = self._upright
        else:
            self._set_yaw(self._yaw + turn)
            self._compose()

    def forget_yaw(self) -> None:
        """The stage moved in a way nobody knows: the next tag fixes the yaw anew."""
        self._fixed = False

    def _foot_in_device(self) -> Array:
        assert self._device is not None
        return rot.multiply(self._device, self._foot_to_sensor)

    def _set_yaw(self, yaw: float) -> None:
        self._yaw, self._turn = yaw, rot.from_yaw(yaw)

    def _compose(self) -> None:
        if self._device is None or self._yaw is None:
            return
        self.sensor_to_stage = rot.multiply(self._turn, self._device)
        self.foot_to_stage = rot.multiply(self.sensor_to_stage, self._foot_to_sensor)


class _Ahrs:
    def __init__(self) -> None:
        self._ahrs = imufusion.Ahrs()
        self._t: int | None = None

    def update(self, t: int, gyro: Array, acc: Array) -> Array:
        dt = 0.0 if self._t is None else (t - self._t) * 1e-9
        self._t = t if self._t is None else max(t, self._t)
        if 0.0 <= dt <= _LONGEST_STEP_S:
            self._ahrs.update_no_magnetometer(np.degrees(gyro), acc / STANDARD_GRAVITY, dt)
        w, x, y, z = self._ahrs.quaternion.wxyz
        return rot.multiply(_Z_UP_TO_Y_UP, rot.normalised([x, y, z, w]))
