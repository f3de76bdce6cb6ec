"""The filters against what every filter must pass, and ours against what only it promises."""

from __future__ import annotations

import numpy as np
import pytest
from foot_runs import START, run
from mixins import FROM, TO, FiniteMixin, RecoveryMixin, scenario

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.config import FootSettings, FusionSettings, Settings
from foottrack_service.fusion.foot_filter import ErrorStateFilter
from foottrack_service.fusion.foot_filter_replay import FLOOR_SIGMA
from foottrack_service.fusion.interface import FootFilter, ImuSample
from foottrack_service.fusion.reference import ReferenceFilter
from foottrack_service.simulation.scenario import simulate


class TestErrorState(RecoveryMixin):
    def make(self) -> FootFilter:
        return ErrorStateFilter(FootSettings(), "left")


class TestPicturesAlone(FiniteMixin):
    """A foot without an IMU."""

    left_imu = False
    after_a_turn = (0.03, 0.15)

    def make(self) -> FootFilter:
        return ErrorStateFilter(FootSettings(), "left")


class TestReference(FiniteMixin):
    believes_numbers = True
    settings = Settings(fusion=FusionSettings(filter="reference"))
    after_a_turn = (0.3, 0.6)

    def make(self) -> FootFilter:
        return ReferenceFilter(FootSettings(), "left")


def ours() -> FootFilter:
    return ErrorStateFilter(FootSettings(), "left")


def test_the_stages_of_the_ladder_follow_the_sources() -> None:
    blind = run(ours, scenario("still", "no pictures"))
    seen = {
        stage: [t for t, e in zip(blind.t, blind.estimates, strict=True) if e.stage == stage]
        for stage in ("marker", "inertial", "lost")
    }
    assert min(seen["marker"]) < 0.3
    assert all(FROM < t < TO + 0.2 for t in seen["inertial"] if t > 0.5)
    assert len([t for t in seen["inertial"] if FROM + 0.2 < t < TO]) > 100
    assert not seen["lost"]


def test_nothing_at_all_coasts_and_is_lost() -> None:
    filter_ = ours()
    for i in range(200):
        filter_.on_imu(ImuSample(i * 5_000_000, np.array([0.0, 9.80665, 0.0]), np.zeros(3), None))
    last = 199 * 5_000_000
    stages = [filter_.estimate(last + round(dt * 1e9)).stage for dt in (0.05, 0.2, 0.3, 0.65)]
    assert stages == ["inertial", "coasting", "coasting", "lost"]


def test_a_foot_imu_alone_starts_on_the_floor() -> None:
    filter_ = ErrorStateFilter(FootSettings(), "right")
    filter_.on_floor(0.5)
    for i in range(100):
        filter_.on_imu(ImuSample(i * 5_000_000, np.array([0.0, 9.80665, 0.0]), np.zeros(3), None))
    estimate = filter_.estimate(99 * 5_000_000)
    assert estimate.p == pytest.approx([0.1, 0.59, 0.0], abs=1e-3)
    assert estimate.contact
    assert estimate.age is None


@pytest.mark.parametrize("task", ["tracker-moving", "still"])
def test_a_foot_without_an_imu_is_tracked_from_pictures(task: str) -> None:
    seen = simulate(task, 5, seconds=5.0, left_imu=False, start=START)
    errors = run(ours, seen).errors(seen, "left", 1.0)
    assert np.median(errors) < 0.015
    assert np.percentile(errors, 95) < 0.05


@pytest.mark.slow
def test_the_radius_holds_the_truth_about_as_often_as_it_says() -> None:
    inside = []
    for seed in range(50, 58):
        seen = simulate("steps", seed, seconds=6.0, imu_hz=200.0, start=START)
        # The simulated floor is where it is said to be; real ones are not, and shoes lift the ankle by more or less.
        floor = FLOOR_SIGMA * float(np.random.default_rng(seed).standard_normal())
        for side in SIDES:

            def beside_the_floor(side: Side = side, floor: float = floor) -> ErrorStateFilter:
                filter_ = ErrorStateFilter(FootSettings(), side)
                filter_.on_floor(floor)
                return filter_

            found = run(beside_the_floor, seen, side)
            sigma = np.array([e.sigma for t, e in zip(found.t, found.estimates, strict=True) if t >= 1.0])
            inside.append(found.errors(seen, side, 1.0)[:, None] < sigma[:, None] * [1.0, 2.0])
    within_one, within_two = np.concatenate(inside).mean(axis=0)
    assert 0.55 < within_one < 0.85
    assert within_two > 0.88
