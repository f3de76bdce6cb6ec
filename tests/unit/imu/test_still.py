"""A recording of a sensor that lay still becomes equidistant samples, or says why it does not."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service.imu.still import NotStill, still_recording

RATE_HZ = 100.0
COUNT = 7000


def gravity(count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.tile([0.0, 9.81, 0.0], (count, 1))


def test_gaps_are_closed_and_counted() -> None:
    t = np.delete(np.arange(COUNT) / RATE_HZ, [100, 3000, 3001])
    found = still_recording(t, gravity(len(t)), None)
    assert found.missing == 3
    assert found.period_s == pytest.approx(1.0 / RATE_HZ)
    assert found.acc.shape == (COUNT, 3) and found.gyro is None


def test_two_samples_in_each_datagram_have_one_stamp() -> None:
    t = np.repeat(np.arange(COUNT // 2) * 2.0 / RATE_HZ, 2)
    found = still_recording(t, gravity(COUNT), np.zeros((COUNT, 3)))
    assert found.missing == 0
    assert found.period_s == pytest.approx(1.0 / RATE_HZ, rel=1e-3)


@pytest.mark.parametrize("count", [0, 1, 5000])
def test_too_short_is_said(count: int) -> None:
    with pytest.raises(NotStill, match="s of samples"):
        still_recording(np.arange(count) / RATE_HZ, gravity(count), None)


def test_who_touched_it_is_told_when() -> None:
    acc = gravity(COUNT)
    acc[4000:] += [0.0, 0.0, 2.0]
    with pytest.raises(NotStill, match="moved 40 s after"):
        still_recording(np.arange(COUNT) / RATE_HZ, acc, None)
