"""Drawn pictures through trackers and fusion, without clocks."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service.config import Settings
from foottrack_service.evaluation.jobs import Job, run_job
from foottrack_service.evaluation.rendered import found_in_pictures, with_pictures
from foottrack_service.simulation.scenario import simulate


def test_finds_come_in_order_late_and_the_same_each_time() -> None:
    scenario = simulate("steps", 1, settings=Settings(), seconds=1.5).at(10**12)
    first = list(with_pictures(scenario, fps=30.0))
    found_in_pictures.cache_clear()
    assert list(with_pictures(scenario, fps=30.0)) == first
    arrivals = [arrival for arrival, _ in first]
    assert arrivals == sorted(arrivals)
    finds = [(arrival, m) for arrival, m in first if m.stream.startswith("marker/")]
    # Nothing of the simulation's own finds is left: all come of 46 pictures.
    assert 60 < len(finds) <= 92
    assert all(arrival - message.t > 20_000_000 for arrival, message in finds)
    assert all(message.t >= 10**12 - 20_000_000 for _, message in finds)


@pytest.mark.slow
def test_feet_are_found_in_pictures_from_end_to_end() -> None:
    result = run_job(Job("steps", 1, "ours", seconds=4.0, camera="rendered"))
    for foot in result.feet.values():
        assert len(foot.errors) > 200
        assert np.median(foot.errors) < 0.02
    assert result.accepted["marker"] > 200


@pytest.mark.slow
def test_depth_carries_on_when_trouser_legs_hang_over_the_tags() -> None:
    # Tags are covered after 3 s; what follows rests on IMUs and depth blobs.
    result = run_job(Job("walk-in-place", 1, "ours", seconds=7.0, camera="rendered", only="depth"))
    assert result.accepted["depth"] > 150
    for side, foot in result.feet.items():
        assert len(foot.errors) > 300
        assert np.median(foot.errors) < 0.03 and np.mean(foot.in_sigma < 2.0) > 0.9
        assert np.percentile(foot.errors, 95) < 0.08, side
