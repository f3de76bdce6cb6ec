"""Axes, angles and pace."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from foottrack_service import unity_axes
from foottrack_service.bridges.interface import Pace
from foottrack_service.rotations import angle_between, from_yaw, normalised, rotate

quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(x * x for x in q) > 0.01).map(normalised)


def test_forward_is_plus_z() -> None:
    assert unity_axes.position((1.0, 2.0, -3.0)) == (1.0, 2.0, 3.0)


@given(quaternions, st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_turning_and_mirroring_can_be_swapped(q: np.ndarray, v: tuple[float, float, float]) -> None:
    assert np.allclose(
        rotate(unity_axes.rotation(q), unity_axes.position(v)), unity_axes.position(rotate(q, v)), atol=1e-9
    )


@given(quaternions)
def test_euler_angles_are_those_of_unity(q: np.ndarray) -> None:
    """Z, then X, then Y about fixed axes is Y, X', Z'' about the body's: scipy's "YXZ"."""
    x, y, z = unity_axes.euler(q)
    assert -90.0 <= x <= 90.0
    again = Rotation.from_euler("YXZ", [y, x, z], degrees=True).as_quat()
    assert angle_between(again, unity_axes.rotation(q)) < 1e-3


@pytest.mark.parametrize(
    ("axis", "angle", "expected"),
    [
        # To the left for us, to the right (clockwise from above) is Unity's positive yaw.
        ([0.0, 1.0, 0.0], 30.0, (0.0, -30.0, 0.0)),
        # Toes up: positive about our +X, negative about Unity's.
        ([1.0, 0.0, 0.0], 20.0, (-20.0, 0.0, 0.0)),
        ([0.0, 0.0, 1.0], 10.0, (0.0, 0.0, 10.0)),
        ([1.0, 0.0, 0.0], 90.0, (-90.0, 0.0, 0.0)),
    ],
)
def test_single_turns(axis: list[float], angle: float, expected: tuple[float, float, float]) -> None:
    half = math.radians(angle) / 2.0
    q = [math.sin(half) * a for a in axis] + [math.cos(half)]
    assert unity_axes.euler(q) == pytest.approx(expected, abs=1e-6)


def test_looking_straight_down_keeps_the_yaw() -> None:
    down = Rotation.from_euler("YXZ", [40.0, 90.0, 0.0], degrees=True).as_quat()
    assert unity_axes.euler([-down[0], -down[1], down[2], down[3]]) == pytest.approx((90.0, 40.0, 0.0), abs=1e-4)


def test_yaw_of_ours_is_minus_yaw_of_unity() -> None:
    assert unity_axes.euler(from_yaw(0.5))[1] == pytest.approx(-math.degrees(0.5))


@pytest.mark.parametrize(("hz", "source_hz", "expected"), [(60.0, 200.0, 60), (100.0, 200.0, 100), (90.0, 50.0, 50)])
def test_the_pace_is_kept(hz: float, source_hz: float, expected: int) -> None:
    pace = Pace(hz)
    sent = sum(pace.lets(round(n * 1e9 / source_hz)) for n in range(int(10 * source_hz)))
    assert abs(sent - 10 * expected) <= 1


@given(st.lists(st.integers(0, 10**10), min_size=1, max_size=50).map(sorted))
def test_no_second_has_more_than_its_share(times: list[int]) -> None:
    pace = Pace(10.0)
    sent = [t for t in times if pace.lets(t)]
    for first in sent:
        assert sum(first <= t < first + 10**9 for t in sent) <= 11


def test_a_clock_that_begins_anew_is_followed() -> None:
    pace = Pace(1.0)
    assert pace.lets(10**15)
    assert pace.lets(0)
    assert not pace.lets(10)
