"""Feet that stand where the floor is not: the filter follows the stairs, seen or in the dark."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service.config import FusionSettings, Settings
from foottrack_service.evaluation.jobs import ScenarioTruth
from foottrack_service.evaluation.run import run_filter
from foottrack_service.simulation.faults import CameraBlackout
from foottrack_service.simulation.scenario import simulate
from foottrack_service.simulation.stairs import RISE, STAIRS

SETTINGS = Settings(fusion=FusionSettings(max_output_hz=100.0))
DARK = [CameraBlackout(start=begin, end=begin + 1.0) for begin in (2.0, 4.5, 7.0, 9.5)]


@pytest.mark.parametrize(("hz", "kind"), [(100.0, "fused"), (400.0, "raw")])
@pytest.mark.parametrize("faults", [[], DARK], ids=["seen", "dark for a second"])
def test_a_foot_on_a_stair_is_not_pulled_down_to_the_floor(hz: float, kind: str, faults: list[CameraBlackout]) -> None:
    scenario = simulate("stairs", 4, seconds=13.0, imu_hz=hz, imu=kind, faults=faults)
    runs, _ = run_filter(scenario.messages(), SETTINGS)
    for side, run in runs.items():
        true = ScenarioTruth(scenario, side).position(run.t)
        late = run.t > 1e9
        standing = run.contact & (true[:, 1] > STAIRS * RISE)
        assert standing.sum() > 100
        assert np.abs((run.p - true)[late, 1]).max() < 0.04
        assert np.abs((run.p - true)[standing, 1]).mean() < 0.015
