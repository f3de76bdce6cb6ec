"""A slow camera finds the feet as well: a webcam in a dark room, a small machine that searches pictures."""

import numpy as np
import pytest

from foottrack_service.config import Settings
from foottrack_service.evaluation.jobs import ScenarioTruth
from foottrack_service.evaluation.run import run_filter
from foottrack_service.simulation.scenario import simulate


@pytest.mark.parametrize("keep_every", [2, 5, 10])
def test_feet_are_found_by_a_camera_of_few_pictures_a_second(keep_every: int) -> None:
    scenario = simulate("steps", 77, seconds=6.0)
    arrivals = (
        (arrival, message)
        for arrival, message in scenario.messages()
        if message.stream.partition("/")[0] not in ("marker", "depth") or message.data.frame % keep_every == 0
    )
    runs, _ = run_filter(arrivals, Settings())
    for side, run in runs.items():
        seen = ~np.isnan(run.age)
        assert np.mean(seen) > 0.85
        true = ScenarioTruth(scenario, side).position(run.t[seen])
        assert np.mean(np.linalg.norm(run.p[seen] - true, axis=1)) < 0.02
