"""The timeline: order, overflow, and that late events end where punctual ones do."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.foot_filter_memory import KEPT, new_foot
from foottrack_service.fusion.interface import HeadSample, ImuSample, OpticalFix, Verdict
from foottrack_service.fusion.timeline import Timeline

MS = 1_000_000


@given(st.lists(st.integers(0, 200), min_size=1, max_size=60))
@settings(deadline=None)
def test_events_are_in_order_however_they_come(stamps: list[int]) -> None:
    timeline = Timeline(new_foot())
    timeline.place(0)
    for number, t in enumerate(stamps, start=1):
        timeline.rows[timeline.place(t), 1] = number
    n = timeline.n
    assert n == len(stamps) + 1
    assert (np.diff(timeline.t[:n]) >= 0).all()
    by_stamp = sorted(range(len(stamps)), key=lambda i: stamps[i])
    assert timeline.rows[1:n, 1].tolist() == [i + 1 for i in by_stamp]


def test_a_full_ring_keeps_the_newest_half() -> None:
    timeline = Timeline(new_foot())
    for t in range(2 * KEPT):
        timeline.place(10 * t)
    assert timeline.n == 2 * KEPT
    place = timeline.place(10 * (2 * KEPT - 3) + 5)
    assert timeline.n == KEPT + 1
    assert timeline.t[place - 1 : place + 3].tolist() == [10 * (2 * KEPT - 3) + d for d in (0, 5, 10, 20)]
    assert timeline.t[0] == 10 * KEPT


def test_what_is_too_late_changes_nothing() -> None:
    timeline = Timeline(new_foot())
    for t in range(100, 200):
        timeline.place(t)
    assert timeline.place(99) == 0
    assert timeline.n == 100


def fix(t: int, p: tuple[float, float, float]) -> OpticalFix:
    head = HeadSample(t, np.array([0.0, 1.6, 0.0]), rot.IDENTITY)
    return OpticalFix(t, "marker", np.array(p), None, None, 1e-6 * np.eye(3), 1.0, 50.0, head, head)


def fed(latency_ms: int) -> InertialFilter:
    """A foot that is pushed and turned about, with fixes that arrive so late."""
    filter_ = InertialFilter(FootSettings(), "left", floor=True)
    random = np.random.default_rng(4)
    acc = np.cumsum(0.3 * random.normal(size=(400, 3)), axis=0) * 0.2 + [0.0, 9.80665, 0.0]
    due: list[OpticalFix] = []
    for i in range(400):
        t = i * 5 * MS
        filter_.on_imu(ImuSample(t, acc[i], 0.6 * random.normal(size=3), None))
        if i % 4 == 0 and i < 380:
            due.append(fix(t - 2 * MS, (-0.1, -1.55, -0.15)))
        for each in [each for each in due if each.t + latency_ms * MS <= t]:
            due.remove(each)
            assert filter_.on_fix(each) in (Verdict.ACCEPTED, Verdict.UNCONFIRMED, Verdict.GATE, Verdict.STALE)
    return filter_


def test_a_late_fix_ends_where_a_punctual_one_does() -> None:
    # It turns too fast to stand: whether a foot stands is decided when its sample comes, by what is known then.
    punctual, late = fed(5).state, fed(60).state
    assert np.allclose(punctual[0], late[0], rtol=0.0, atol=1e-9)
    assert np.allclose(punctual[1], late[1], rtol=1e-9, atol=1e-12)


def test_no_fix_is_taken_from_before_the_ring_or_far_ahead() -> None:
    filter_ = fed(5)
    assert filter_.on_fix(fix(399 * 5 * MS - 900 * MS, (0.0, -1.5, 0.0))) is Verdict.STALE
    assert filter_.on_fix(fix(399 * 5 * MS + 200 * MS, (0.0, -1.5, 0.0))) is Verdict.UNUSED
