"""Down the ladder and up again, as the live core announces it in ``pose/body``: source after source falls silent."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

import numpy as np

from foottrack_protocol import Message
from foottrack_service.config import FusionSettings, Settings
from foottrack_service.evaluation.jobs import ScenarioTruth
from foottrack_service.evaluation.run import STAGES, run_filter
from foottrack_service.simulation.scenario import simulate

SILENT = {
    "marker/left": [(3.0, 9.0)],
    "depth/left": [(4.0, 8.0), (8.5, 10.0)],
    "imu/left": [(5.0, 7.0)],
}
"""s: when which of the left foot's sources say nothing."""


def test_the_whole_ladder_down_and_up_again() -> None:
    scenario = simulate("still", 11, seconds=10.0)

    def heard() -> Iterator[tuple[int, Message]]:
        for arrival, message in scenario.messages():
            if not any(begin <= message.t * 1e-9 < end for begin, end in SILENT.get(message.stream, [])):
                yield arrival, message

    run = run_filter(heard(), Settings(fusion=FusionSettings(max_output_hz=100.0)))[0]["left"]
    t = run.t * 1e-9
    run, t = run.cut(t > 2.0), t[t > 2.0]
    names = [STAGES[k] for k in run.stage]
    # Blobs are looked at when no tag has been for 0.1 s, and a picture is some 30 ms old when it comes.
    spells = [(name, [moment for _, moment in spell]) for name, spell in groupby(zip(names, t, strict=True), _name)]
    rungs = [name for name, moments in spells if moments[-1] - moments[0] > 0.05]
    assert rungs == ["marker", "depth", "inertial", "coasting", "lost", "depth", "inertial", "marker"]
    begins = [moments[0] for _, moments in spells if moments[-1] - moments[0] > 0.05]
    # 0.1 s after each source's last word; coasting lasts for half a second, or until sigma is 0.3 m.
    assert np.abs(np.array(begins[1:4]) - [3.1, 4.1, 5.1]).max() < 0.06
    assert 5.3 < begins[4] < 5.65
    error = np.linalg.norm(run.p - ScenarioTruth(scenario, "left").position(run.t), axis=1)
    assert (error < 3.0 * run.sigma).all()
    sigma = {name: np.median(run.sigma[np.array(names) == name]) for name in STAGES}
    assert sigma["marker"] <= sigma["depth"] < sigma["coasting"] < sigma["lost"]
    assert error[t > 9.6].max() < 0.01


def _name(moment: tuple[str, float]) -> str:
    return moment[0]
