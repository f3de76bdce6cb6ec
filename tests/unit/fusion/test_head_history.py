"""The head's history: interpolation, holes, order, recentring, broken input."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_service.fusion.head_history import HeadHistory
from foottrack_service.fusion.interface import HeadSample
from foottrack_service.rotations import IDENTITY, Array, angle_between, from_yaw

MS = 1_000_000


def sample(t_ms: float, x: float = 0.0, yaw: float = 0.0) -> HeadSample:
    return HeadSample(int(t_ms * MS), np.array([x, 1.7, 0.0]), from_yaw(yaw))


def pose_at(history: HeadHistory, t_ms: float) -> HeadSample:
    found = history.at(int(t_ms * MS))
    assert found is not None
    return found


def test_interpolates_between_neighbours() -> None:
    history = HeadHistory()
    history.add(sample(0, x=0.0, yaw=0.0))
    history.add(sample(10, x=1.0, yaw=0.4))
    quarter = pose_at(history, 2.5)
    assert quarter.t == 2_500_000
    np.testing.assert_allclose(quarter.p, [0.25, 1.7, 0.0], atol=1e-12)
    assert angle_between(quarter.q, from_yaw(0.1)) < 1e-9


def test_takes_the_short_way_whatever_the_signs() -> None:
    history = HeadHistory()
    history.add(sample(0, yaw=0.0))
    b = sample(10, yaw=0.2)
    history.add(HeadSample(b.t, b.p, -b.q))
    assert angle_between(pose_at(history, 5).q, from_yaw(0.1)) < 1e-9


def test_exact_stamps_and_the_ends() -> None:
    history = HeadHistory()
    assert history.newest is None
    assert history.at(0) is None
    history.add(sample(10, x=0.5))
    history.add(sample(20, x=0.7))
    assert pose_at(history, 10).p[0] == 0.5
    assert pose_at(history, 20).p[0] == 0.7
    assert history.at(9 * MS) is None
    assert history.at(21 * MS) is None
    assert history.newest is not None
    assert history.newest.p[0] == 0.7


@pytest.mark.parametrize(("gap_ms", "known"), [(100, True), (101, False)])
def test_never_across_a_hole(gap_ms: int, known: bool) -> None:
    history = HeadHistory()
    history.add(sample(0))
    history.add(sample(gap_ms))
    assert (history.at(50 * MS) is not None) is known


def test_an_untracked_pose_is_a_hole() -> None:
    history = HeadHistory()
    history.add(sample(0))
    history.add_untracked(10 * MS)
    assert history.newest is None
    history.add(sample(20))
    history.add(sample(30))
    assert history.at(5 * MS) is None
    assert history.at(10 * MS) is None
    assert history.at(15 * MS) is None
    assert history.at(25 * MS) is not None


@given(st.lists(st.permutations(range(3)), min_size=3, max_size=3))
def test_neighbours_may_arrive_in_any_order(turns: list[list[int]]) -> None:
    history = HeadHistory()
    for i in [3 * block + k for block, turn in enumerate(turns) for k in turn]:
        history.add(sample(10 * i, x=0.1 * i))
    assert pose_at(history, 33).p[0] == pytest.approx(0.33)


def test_a_repeated_stamp_is_replaced() -> None:
    history = HeadHistory()
    history.add(sample(10, x=1.0))
    history.add(sample(10, x=2.0))
    assert pose_at(history, 10).p[0] == 2.0


def test_old_poses_are_forgotten() -> None:
    history = HeadHistory()
    for i in range(400):
        history.add(sample(10 * i))
    assert history.at(2400 * MS) is None
    assert history.at(2600 * MS) is not None


def test_a_clock_that_jumps_back_starts_again() -> None:
    history = HeadHistory()
    history.add(sample(100_000))
    history.add(sample(10, x=1.0))
    history.add(sample(20, x=2.0))
    assert pose_at(history, 15).p[0] == pytest.approx(1.5)
    assert history.newest is not None
    assert history.newest.t == 20 * MS


@pytest.mark.parametrize("ahead_ms", [50, 250, 1000])
def test_poses_of_a_clock_that_is_set_back_are_not_mixed_with_those_that_it_stamped_ahead(ahead_ms: int) -> None:
    history = HeadHistory()
    for i in range(100):
        history.add(sample(10 * i + ahead_ms, x=1.0))
    for i in range(100, 120):
        history.add(sample(10 * i, x=2.0))
        assert history.newest is not None
        assert history.newest.p[0] == 2.0
    assert pose_at(history, 1095).p[0] == 2.0


@pytest.mark.parametrize(
    ("p", "q"),
    [
        (np.array([np.nan, 0.0, 0.0]), IDENTITY),
        (np.zeros(3), np.array([0.0, np.inf, 0.0, 1.0])),
        (np.zeros(3), np.zeros(4)),
    ],
)
def test_what_is_not_finite_is_left_out(p: Array, q: Array) -> None:
    history = HeadHistory()
    history.add(sample(0))
    history.add(HeadSample(10 * MS, p, q))
    history.add(sample(20))
    assert np.isfinite(pose_at(history, 10).q).all()


def test_recentring_moves_every_pose() -> None:
    history = HeadHistory()
    history.add(sample(0, x=1.0))
    history.add(sample(10, x=1.0))
    history.move(np.array([0.0, 0.0, 2.0]), from_yaw(np.pi / 2))
    moved = pose_at(history, 5)
    np.testing.assert_allclose(moved.p, [0.0, 1.7, 1.0], atol=1e-12)
    assert angle_between(moved.q, from_yaw(np.pi / 2)) < 1e-9
    history.clear()
    assert history.newest is None
