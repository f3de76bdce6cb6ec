"""Where the pelvis faces: slowly with the head, at once with the feet, never far from them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.body.facing import MOST_TURN, SETTLE_S, PelvisFacing, foot_yaw, head_yaw

SECOND = 1_000_000_000
angle = st.floats(-math.pi, math.pi)


def test_it_begins_where_head_and_feet_say() -> None:
    assert PelvisFacing().update(0, 0.2, [0.1, 0.2]) == pytest.approx(0.2)
    assert PelvisFacing().update(0, 2.0, [0.1, 0.2]) == pytest.approx(0.15 + MOST_TURN)
    assert PelvisFacing().update(0, 2.0, []) == pytest.approx(2.0)
    assert PelvisFacing().update(0, None, [0.1, 0.2]) == pytest.approx(0.15)
    assert PelvisFacing().update(0, None, []) == 0.0


def test_a_look_aside_turns_it_slowly_and_not_far() -> None:
    facing = PelvisFacing()
    facing.update(0, 0.0, [0.0, 0.0])
    after = facing.update(round(SETTLE_S * SECOND), 1.5, [0.0, 0.0])
    assert after == pytest.approx(MOST_TURN * (1.0 - math.exp(-1.0)))


def test_it_turns_with_the_feet_at_once() -> None:
    facing = PelvisFacing()
    facing.update(0, 0.0, [0.0, 0.0])
    assert facing.update(1000, 1.0, [1.0, 1.0]) == pytest.approx(1.0, abs=1e-4)


def test_rates_do_not_matter() -> None:
    fine, coarse = PelvisFacing(), PelvisFacing()
    for t in range(0, SECOND + 1, SECOND // 200):
        slow = fine.update(t, 0.4 if t else 0.0, [0.0, 0.0])
    coarse.update(0, 0.0, [0.0, 0.0])
    assert coarse.update(SECOND, 0.4, [0.0, 0.0]) == pytest.approx(slow, abs=1e-6)


def test_a_foot_that_appears_does_not_turn_it_at_once() -> None:
    facing = PelvisFacing()
    before = facing.update(0, 0.0, [0.2])
    assert facing.update(SECOND // 200, 0.0, [0.2, -0.6]) == pytest.approx(before, abs=0.02)


def test_after_a_hole_or_a_new_stage_it_begins_anew() -> None:
    facing = PelvisFacing()
    facing.update(0, 0.0, [])
    assert facing.update(2 * SECOND, 1.0, []) == 1.0
    facing.reset()
    assert facing.update(2 * SECOND + 1, -1.0, []) == -1.0


@given(st.lists(st.tuples(st.integers(-(10**9), 10**10), angle, st.lists(angle, max_size=2)), max_size=30))
def test_it_is_always_a_number_and_near_feet_that_agree(updates) -> None:
    facing = PelvisFacing()
    for t, head, feet in updates:
        yaw = facing.update(t, head, feet)
        assert -math.pi <= yaw <= math.pi


@given(angle, st.floats(-1.5, 1.5))
def test_yaws_of_head_and_foot_as_rotations_have_them(yaw, pitch) -> None:
    q = rot.multiply(rot.from_yaw(yaw), rot.from_axis_angle([1.0, 0.0, 0.0], pitch))
    assert math.remainder(head_yaw(q.tolist()) - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert math.remainder(foot_yaw(q.tolist()) - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_a_foot_that_points_down_keeps_its_yaw_where_its_toes_lose_theirs() -> None:
    down = rot.multiply(rot.from_yaw(0.3), rot.from_axis_angle([1.0, 0.0, 0.0], math.radians(-100.0)))
    assert foot_yaw(down.tolist()) == pytest.approx(0.3)
    assert abs(math.remainder(float(rot.yaw_of(down)) - 0.3, 2.0 * math.pi)) > 3.0
