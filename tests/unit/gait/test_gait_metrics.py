"""Metrics on signals with known answers."""

import numpy as np
import pytest

from foottrack_service.evaluation.gait_cases import HELD_OUT_SEED, cases
from foottrack_service.evaluation.gait_metrics import correlation_and_lag, jumps_m, match, skates_m
from foottrack_service.evaluation.gait_real import bob_hz, bobs_of

T = np.arange(0.0, 10.0, 0.005)


def test_match_takes_each_instant_once_and_the_nearest_first():
    found = match(np.array([1.0, 2.0, 3.0]), np.array([1.05, 1.1, 2.9, 9.0]))
    assert (found.true, found.found, found.extra) == (3, 2, 2)
    assert sorted(found.errors) == pytest.approx([-0.1, 0.05])
    assert match(np.array([]), np.array([1.0])).extra == 1


def test_a_jump_is_measured_and_motion_is_not():
    smooth = np.stack([np.sin(8.0 * T), np.cos(8.0 * T)], axis=-1)
    assert np.max(jumps_m(T, smooth)) < 1e-3
    ramp = np.outer(np.where(T > 5.0, T - 5.0, 0.0), [2.0, 0.0])
    assert np.max(jumps_m(T, ramp)) < 1e-9
    smooth[T > 5.0, 0] += 0.05
    assert np.max(jumps_m(T, smooth)) == pytest.approx(0.05, rel=0.1)


@pytest.mark.parametrize("hz", [100, 200, 400])
@pytest.mark.parametrize("part", ["planted", "leaving", "rising", "fastest", "top", "falling"])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_jump_of_5_mm_shows_wherever_it_happens(hz, part, axis):
    """Within a swing of 62 mm of way per frame of its own at 100 Hz, with a break of the pace at the landing."""
    t = np.arange(0.0, 3.0, 1.0 / hz) + 1e-4 * np.sin(np.arange(3 * hz))
    share = np.clip((t - 1.0) / 0.3, 0.0, 1.0)
    height, q = 0.1 * np.sin(np.pi * share) ** 2, share - np.sin(2.0 * np.pi * share) / (2.0 * np.pi)
    p = np.stack([0.93 * q - 1.5 * np.maximum(0.0, t - 1.3), height], axis=-1)
    own = jumps_m(t, p)
    assert np.max(own) < 0.0015
    at = {"planted": 0.6, "leaving": 1.04, "rising": 1.1, "fastest": 1.15, "top": 1.16, "falling": 1.22}[part]
    for spread in {1, max(1, hz // 100)}:  # in one frame, or in all frames of one picture of an engine
        moved = p.copy()
        first = int(np.searchsorted(t, at))
        moved[:, axis] += 0.005 * np.clip((np.arange(len(t)) - first + 1) / spread, 0.0, 1.0)
        found = jumps_m(t, moved)
        assert np.max(found) == pytest.approx(0.005, abs=0.0025)
        assert abs(t[int(np.argmax(found))] - at) < 0.03


def test_a_foot_that_goes_back_as_fast_as_the_avatar_goes_does_not_skate():
    z = 0.3 - 1.2 * (T % 0.5)
    planted = T % 0.5 < 0.45
    height, speed = np.where(planted, 0.0, 0.1), np.full(len(T), 1.2)
    assert max(skates_m(T, z, height, speed, planted)) < 1e-9
    assert np.median(skates_m(T, z, height, 0.5 * speed, planted)) == pytest.approx(0.6 * 0.445, rel=0.02)


def test_lag_and_correlation():
    user, late = np.sin(2 * np.pi * T), np.sin(2 * np.pi * (T - 0.03))
    r, lag = correlation_and_lag(T, late, user)
    assert lag == pytest.approx(0.03, abs=0.001)
    assert r == pytest.approx(np.cos(2 * np.pi * 0.03), abs=0.01)
    assert correlation_and_lag(T, np.zeros(len(T)), user) is None


@pytest.mark.parametrize("hz", [1.9, 2.1, 2.3])
def test_a_bob_s_frequency_whatever_is_slow_beside_it(hz):
    """Windows of 4 s of a head that bobs by 8 to 3 cm, sinks, rises, and pauses for 1 s."""
    t = np.arange(0.0, 20.0, 1.0 / 72.0)
    drift = np.interp(t, [0.0, 5.0, 7.0, 12.0, 20.0], [0.0, 0.05, -0.02, 0.03, 0.0])
    bobs, rate = bobs_of(t, 1.7 + drift + (0.04 - 0.00125 * t) * np.cos(2 * np.pi * hz * t) * ((t < 9) | (t > 10)))
    found = [bob_hz(bobs[(t >= begin) & (t < begin + 4.0)], rate) for begin in range(0, 16, 2)]
    assert rate == pytest.approx(72.0)
    assert [f for f in found if f is not None] == pytest.approx([hz] * sum(f is not None for f in found), abs=0.015)
    assert sum(f is not None for f in found) >= 6
    assert bob_hz(np.random.default_rng(0).normal(0.0, 0.01, 288), rate) is None


def test_every_cadence_meets_every_peak_on_seeds_that_nothing_was_tuned_on():
    found = cases([1, 2])
    assert all(case.seed > HELD_OUT_SEED for case in found)
    assert len({(case.cadence, case.peak) for case in found if case.kind == "in place" and not case.turn}) == 20
    assert {(case.imu_hz, case.camera) for case in found} == {
        (100.0, True),
        (100.0, False),
        (400.0, True),
        (400.0, False),
    }
    assert len({case.height for case in found if case.kind == "in place"}) == 3
