"""Device axes to the wire's."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations
from foottrack_service.imu.axes import Axes
from foottrack_service.imu.sample import DeviceSample, gravity_in_device, unit_quaternion

ALL = [
    "".join(f"{sign}{axis}" for sign, axis in zip(signs, order, strict=True))
    for order in itertools.permutations("xyz")
    for signs in itertools.product("+-", repeat=3)
]


def proper(text: str) -> bool:
    matrix = np.zeros((3, 3))
    for row in range(3):
        matrix[row, "xyz".index(text[2 * row + 1])] = 1.0 if text[2 * row] == "+" else -1.0
    return bool(np.linalg.det(matrix) > 0.0)


def test_a_chip_flat_on_the_foot_reads_as_the_foot() -> None:
    axes = Axes()
    # The chip lies flat, y to the toes, its world's y where they point: it feels up on its z.
    sample = DeviceSample(0, (0.1, 0.2, 9.8), (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    imu = axes.to_wire(sample, 5, 7)
    back = axes.from_wire(imu.acc, imu.gyro, imu.q, 0)
    assert (back.acc, back.gyro) == (sample.acc, sample.gyro)
    assert rotations.angle_between(back.q, sample.q) < 1e-12
    assert imu.acc == (0.1, 9.8, -0.2)
    assert imu.gyro == (1.0, 3.0, -2.0)
    assert imu.q == (0.0, 0.0, 0.0, 1.0)
    assert (imu.t_dev, imu.t_arr) == (5, 7)


@pytest.mark.parametrize("text", [text for text in ALL if proper(text)])
def test_gravity_is_up_in_the_wires_world_for_any_axes_and_attitude(text: str) -> None:
    axes = Axes(text)
    rng = np.random.default_rng(3)
    for _ in range(10):
        q = tuple(float(v) for v in rotations.normalised(rng.normal(size=4)))
        at_rest = gravity_in_device(q)  # type: ignore[arg-type]
        up = rotations.rotate(axes.rotation(q), axes.vector(at_rest))  # type: ignore[arg-type]
        np.testing.assert_allclose(up, [0.0, STANDARD_GRAVITY, 0.0], atol=1e-12)
        np.testing.assert_allclose(
            np.abs(np.dot(axes.device_rotation(axes.rotation(q)), q)),
            1.0,
            atol=1e-12,  # type: ignore[arg-type]
        )
        np.testing.assert_allclose(axes.device_vector(axes.vector(at_rest)), at_rest)


def test_both_ways_to_turn_a_quaternion_agree() -> None:
    axes = Axes()
    q = tuple(float(v) for v in rotations.normalised([0.3, -0.2, 0.5, 0.8]))
    fast = axes.rotation(q)  # type: ignore[arg-type]
    axes._same = False
    assert rotations.angle_between(fast, axes.rotation(q)) < 1e-12  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text", ["", "xyz", "+x+y", "+x+y+y", "+x+z+y", "+a+b+c", *[t for t in ALL if not proper(t)][:3]]
)
def test_what_is_no_rotation_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="axes"):
        Axes(text)


def test_gravity_in_the_device_is_what_the_rotations_say() -> None:
    rng = np.random.default_rng(4)
    for q in rotations.normalised(rng.normal(size=(20, 4))):
        expected = rotations.unrotate(q, [0.0, 0.0, STANDARD_GRAVITY])
        np.testing.assert_allclose(gravity_in_device(tuple(q)), expected, atol=1e-12)


def test_a_quaternion_of_wrong_length_or_none_is_no_rotation() -> None:
    assert unit_quaternion(0.0, 0.0, 0.0, 1.04, 0.05) == (0.0, 0.0, 0.0, 1.0)
    assert unit_quaternion(0.0, 0.0, 0.0, 1.06, 0.05) is None
    assert unit_quaternion(float("nan"), 0.0, 0.0, 1.0, 0.05) is None
    assert unit_quaternion(float("inf"), 0.0, 0.0, 1.0, 0.05) is None
