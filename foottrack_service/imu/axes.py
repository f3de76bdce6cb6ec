"""From a device's axes to the wire's, and back for simulated devices."""

from __future__ import annotations

import re

import numpy as np

from foottrack_protocol.messages import Imu
from foottrack_service import rotations
from foottrack_service.imu.sample import DeviceSample, Quat, Vec3

FLAT_ON_THE_FOOT = "+x+z-y"
"""A chip whose face looks up and whose y points to the toes: x stays right, its z is up, its y is forward (-Z)."""

_Z_UP_TO_Y_UP = rotations.from_rotation_vector([-np.pi / 2.0, 0.0, 0.0])


class Axes:
    """Which of the device's axes the wire's sensor axes x (right), y (up), z (back) are, as ``+x+z-y``.

    Also turns the device's z-up world into the wire's y-up one. Raises ValueError where the text is not three different
    axes with signs that make a rotation.
    """

    def __init__(self, text: str = FLAT_ON_THE_FOOT) -> None:
        if re.fullmatch(r"([+-][xyz]){3}", text) is None:
            raise ValueError(f"axes {text!r}: three signed axes are needed, such as {FLAT_ON_THE_FOOT}")
        self._index = tuple("xyz".index(text[at]) for at in (1, 3, 5))
        self._sign = tuple(1.0 if text[at] == "+" else -1.0 for at in (0, 2, 4))
        matrix = np.zeros((3, 3))
        matrix[range(3), self._index] = self._sign
        if not np.isclose(np.linalg.det(matrix), 1.0):
            raise ValueError(f"axes {text!r}: an axis is missing, or they are left-handed")
        to_sensor = rotations.from_matrix(matrix)
        self._world = _Z_UP_TO_Y_UP
        self._from_sensor = rotations.conjugate(to_sensor)
        self._same = bool(rotations.angle_between(to_sensor, _Z_UP_TO_Y_UP) < 1e-9)

    def vector(self, v: Vec3) -> Vec3:
        """A vector of the device's axes in the wire's sensor axes."""
        i, s = self._index, self._sign
        return s[0] * v[i[0]], s[1] * v[i[1]], s[2] * v[i[2]]

    def rotation(self, q: Quat) -> Quat:
        """Device to z-up world, as sensor to y-up world."""
        # W q A^-1; where A is W, turning both frames alike only permutes the vector part: 30 times faster.
        if self._same:
            x, y, z = self.vector((q[0], q[1], q[2]))
            return x, y, z, q[3]
        return _quat(rotations.multiply(rotations.multiply(self._world, q), self._from_sensor))

    def device_vector(self, v: Vec3) -> Vec3:
        """The inverse of ``vector``."""
        out = [0.0, 0.0, 0.0]
        for at in range(3):
            out[self._index[at]] = self._sign[at] * v[at]
        return out[0], out[1], out[2]

    def device_rotation(self, q: Quat) -> Quat:
        """The inverse of ``rotation``."""
        back = rotations.multiply(rotations.conjugate(self._world), q)
        return _quat(rotations.multiply(back, rotations.conjugate(self._from_sensor)))

    def to_wire(self, sample: DeviceSample, t_dev_us: int | None, t_arr: int) -> Imu:
        """The wire's body. ``t_dev_us`` is the unwrapped counter, ``t_arr`` the arrival, ns. Raises ValidationError."""
        return Imu(
            acc=self.vector(sample.acc),
            gyro=None if sample.gyro is None else self.vector(sample.gyro),
            q=None if sample.q is None else self.rotation(sample.q),
            t_dev=t_dev_us,
            t_arr=t_arr,
            accuracy=sample.accuracy,
        )

    def from_wire(self, acc: Vec3, gyro: Vec3 | None, q: Quat | None, ticks: int | None) -> DeviceSample:
        """What a device would have measured, for a simulated one."""
        return DeviceSample(
            ticks,
            self.device_vector(acc),
            None if gyro is None else self.device_vector(gyro),
            None if q is None else self.device_rotation(q),
        )


def _quat(q: rotations.Array) -> Quat:
    x, y, z, w = (float(value) for value in q)
    return x, y, z, w
