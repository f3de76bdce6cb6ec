"""Metrics on signals whose answers are known."""

import numpy as np
import pytest

from foottrack_service.evaluation import metrics
from foottrack_service.evaluation.statistics import summary_mm
from foottrack_service.evaluation.truth import TruthTrack

SECONDS = np.arange(0.0, 10.0, 0.01)


def sine(seconds):
    return np.stack([np.sin(2.0 * seconds), 0.3 * np.cos(5.0 * seconds), np.zeros_like(seconds)], axis=-1)


@pytest.mark.parametrize("shift", [-0.0203, 0.0, 0.0031, 0.085, 0.31])
def test_lag_of_a_shifted_sine(shift):
    assert metrics.lag_s(SECONDS, sine(SECONDS - shift) + [1.0, 2.0, 3.0], sine) == pytest.approx(shift, abs=1e-4)


def test_lag_survives_noise():
    noisy = sine(SECONDS - 0.04) + np.random.default_rng(1).normal(0.0, 0.01, (len(SECONDS), 3))
    assert metrics.lag_s(SECONDS, noisy, sine) == pytest.approx(0.04, abs=2e-3)


def test_what_does_not_move_has_no_lag():
    assert metrics.lag_s(SECONDS, np.zeros((len(SECONDS), 3)), lambda t: np.zeros((len(t), 3))) is None


def test_jitter_of_white_noise():
    noise = np.random.default_rng(2).normal(0.0, 0.002, (200_000, 3))
    around, steps = metrics.jitter_m(noise + [0.1, 0.2, 0.3], np.zeros_like(noise))
    assert around == pytest.approx(0.002 * np.sqrt(3), rel=0.01)
    assert steps == pytest.approx(0.002 * np.sqrt(6), rel=0.01)


def test_skate_of_a_slow_slide():
    """A foot that stands for 1 s, flies for 1 s, and slides at 10 mm/s while it stands again for 2 s."""
    t = np.arange(0.0, 4.0, 0.01)
    x = np.where(t < 2.0, 0.0, 0.01 * (t - 2.0))
    track = np.stack([x, np.zeros_like(t), np.zeros_like(t)], axis=-1)
    planted = (t < 1.0) | (t >= 2.0)
    assert metrics.skate_m(track, planted) == pytest.approx([0.0, 0.0199], abs=1e-9)


def test_peak_delay_begins_at_the_onset():
    errors = np.where(np.abs(SECONDS - 4.3) < 0.005, 1.0, 0.01)
    errors[10] = 5.0
    assert metrics.peak_delay_s(SECONDS, errors, 4.0) == pytest.approx(0.3)


def test_shares_within_sigma_of_an_honest_normal():
    errors = np.linalg.norm(np.random.default_rng(3).normal(0.0, 1.0, (100_000, 3)), axis=1)
    shares = metrics.within_sigma(errors, np.full(len(errors), 1.8779))
    assert shares["1"] == pytest.approx(0.6827, abs=0.005)
    assert shares["3"] == 1.0


def test_summary():
    assert summary_mm(np.array([0.001, 0.002, 0.003, 0.010])) == {
        "mean": 4.0,
        "median": 2.5,
        "p95": pytest.approx(8.95),
        "max": 10.0,
    }
    assert summary_mm(np.array([]))["max"] is None


def test_truth_is_interpolated_smoothly_and_not_across_holes():
    stamps = (np.arange(0.0, 5.0, 0.01) * 1e9).astype(np.int64)
    keep = np.ones(len(stamps), dtype=bool)
    keep[200:230] = False
    q = np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    track = TruthTrack(stamps[keep], sine(stamps * 1e-9)[keep], q[keep])
    between = (np.arange(0.1, 1.9, 0.0037) * 1e9).astype(np.int64)
    assert np.max(np.abs(track.position(between) - sine(between * 1e-9))) < 1e-6
    assert np.all(track.covers(between))
    assert not np.any(track.covers(np.array([2_100_000_000, -1, 6_000_000_000])))


def test_too_little_truth_is_refused():
    with pytest.raises(ValueError, match="too few"):
        TruthTrack([0, 1], [[0, 0, 0]] * 2, [[0, 0, 0, 1]] * 2)
