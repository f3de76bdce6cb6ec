"""Two-bone legs: lengths, direction, and that no foot makes a knee flip."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.body.legs import knee, knee_axis
from foottrack_service.body.skeleton import Skeleton

RIGHT, FORWARD = (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
EVEN = Skeleton(1.75, 0.5, 0.5, 0.7, 0.2, 0.09)
UNEVEN = Skeleton(1.75, 0.45, 0.38, 0.7, 0.2, 0.09)

coordinate = st.floats(-2.0, 2.0)
point = st.tuples(coordinate, coordinate, coordinate)
angle = st.floats(-math.pi, math.pi)


def foot(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> tuple[float, ...]:
    """Rotation of a foot; positive pitch lifts the heel above the toes."""
    turn = rot.multiply(rot.from_yaw(yaw), rot.from_axis_angle([1.0, 0.0, 0.0], -pitch))
    return tuple(rot.multiply(turn, rot.from_axis_angle([0.0, 0.0, 1.0], roll)).tolist())


def test_the_knee_of_a_3_4_5_triangle() -> None:
    assert knee((0.0, 1.0, 0.0), (0.0, 0.2, 0.0), RIGHT, FORWARD, EVEN) == pytest.approx((0.0, 0.6, -0.3))


def test_a_leg_that_is_lifted_forwards_has_its_knee_above() -> None:
    assert knee((0.0, 1.0, 0.0), (0.0, 1.0, -0.8), RIGHT, FORWARD, EVEN) == pytest.approx((0.0, 1.3, -0.4))


@given(point, angle, st.floats(-1.5, 1.5), st.floats(0.07, 0.83), angle)
def test_bones_keep_their_lengths_to_a_micrometre_wherever_the_leg_reaches(hip, round_up, tilt, length, yaw) -> None:
    down = (math.sin(tilt) * math.cos(round_up), -math.cos(tilt), math.sin(tilt) * math.sin(round_up))
    ankle = tuple(h + length * d for h, d in zip(hip, down, strict=True))
    axis = (math.cos(yaw), 0.0, -math.sin(yaw))
    found = knee(hip, ankle, axis, (-math.sin(yaw), 0.0, -math.cos(yaw)), UNEVEN)
    assert math.dist(hip, found) == pytest.approx(UNEVEN.thigh, abs=1e-6)
    assert math.dist(found, ankle) == pytest.approx(UNEVEN.shank, abs=1e-6)


@given(point, point, angle)
def test_knees_bend_forwards_only(hip, ankle, yaw) -> None:
    assume(ankle[1] < hip[1] - 1e-3)
    forward = np.array([-math.sin(yaw), 0.0, -math.cos(yaw)])
    found = knee(hip, ankle, (math.cos(yaw), 0.0, -math.sin(yaw)), tuple(forward), UNEVEN)
    leg = np.subtract(ankle, hip) / math.dist(ankle, hip)
    out = np.subtract(found, hip) - leg * np.dot(np.subtract(found, hip), leg)
    assert np.dot(out, forward) > -1e-9


@given(point, point)
def test_a_leg_that_cannot_reach_is_straight_and_keeps_its_thigh(hip, ankle) -> None:
    assume(math.dist(hip, ankle) > UNEVEN.thigh + UNEVEN.shank)
    found = knee(hip, ankle, RIGHT, FORWARD, UNEVEN)
    share = UNEVEN.thigh / math.dist(hip, ankle)
    assert np.allclose(found, np.array(hip) + share * np.subtract(ankle, hip), atol=1e-6)


@pytest.mark.parametrize("ankle", [(0.0, 1.0, 0.0), (0.7, 1.0, 0.0), (-0.7, 1.0, 0.0)])
def test_legs_without_a_direction_to_bend_to_still_have_a_knee(ankle) -> None:
    found = knee((0.0, 1.0, 0.0), ankle, RIGHT, FORWARD, EVEN)
    assert np.isfinite(found).all()
    assert math.dist(found, (0.0, 1.0, 0.0)) == pytest.approx(0.5)


def test_the_foot_turns_the_axis_by_its_share() -> None:
    x, y, z = knee_axis(RIGHT, FORWARD, foot(yaw=math.radians(20.0)))
    assert y == 0.0
    assert 0.2 * 20.0 < math.degrees(math.atan2(-z, x)) < 0.5 * 20.0


def test_no_flip_at_push_off_nor_with_a_foot_that_points_down() -> None:
    """Heel up from flat to 20 deg beyond straight down, 5 deg turned out: the axis does not even move."""
    axes = [knee_axis(RIGHT, FORWARD, foot(0.09, pitch)) for pitch in np.linspace(0.0, math.radians(110.0), 200)]
    assert np.ptp(axes, axis=0).max() < 1e-9


@given(angle, angle, angle)
def test_no_attitude_of_a_foot_turns_its_knee_round(yaw, pitch, roll) -> None:
    x, y, z = knee_axis(RIGHT, FORWARD, foot(yaw, pitch, roll))
    assert math.hypot(x, y, z) == pytest.approx(1.0)
    assert x > 0.9


def test_the_axis_is_continuous_while_a_foot_turns_all_the_way_round() -> None:
    axes = np.array([knee_axis(RIGHT, FORWARD, foot(yaw)) for yaw in np.radians(np.arange(0.0, 361.0))])
    assert np.linalg.norm(np.diff(axes, axis=0), axis=1).max() < math.radians(1.0)
