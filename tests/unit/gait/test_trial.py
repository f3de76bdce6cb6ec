"""[Z]'s trial: the countdown does not count, the finish is within an interval."""

import pytest

from foottrack_service.gait.trial import Trial

S = 1_000_000_000


def run(speeds, distance=10.0, period=0.1):
    trial = Trial(distance=distance, countdown=3.0)
    for k, speed in enumerate(speeds):
        trial.update(round(k * period * S), speed, 5 + k // 10)
    return trial


def test_fifty_metres_at_two_metres_per_second_take_25_seconds_after_the_countdown():
    result = run([2.0] * 400, distance=50.0).result
    assert result.finished
    assert result.seconds == pytest.approx(25.0, abs=1e-6)
    assert (result.distance, result.mean_speed, result.top_speed) == pytest.approx((50.0, 2.0, 2.0))


def test_the_countdown_does_not_count():
    trial = run([3.0] * 30)
    assert trial.distance == 0.0
    assert trial.countdown(round(2.5 * S)) == pytest.approx(0.5)
    assert trial.countdown(4 * S) == 0.0


def test_steps_are_counted_from_go():
    result = run([1.0] * 80).result
    assert result.steps == (5 + 79 // 10) - (5 + 30 // 10)
    assert not result.finished
    assert result.distance == pytest.approx(4.9)


def test_a_pause_of_the_stream_takes_time_and_moves_nobody():
    trial = Trial(distance=10.0, countdown=0.0)
    for t in (0.0, 0.1, 5.1, 5.2):
        trial.update(round(t * S), 1.0, 0)
    assert trial.result.distance == pytest.approx(0.2)
    assert trial.result.seconds == pytest.approx(5.2)
