"""Evaluation end to end on short runs: shapes, sanity, and that a recording gives what the simulation gives."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from foottrack_service.cli.main import app
from foottrack_service.cli.running import EXIT_USAGE, CommandFailed
from foottrack_service.cli.sim import write_recording
from foottrack_service.config import Settings
from foottrack_service.evaluation.jobs import Job, gap_windows, run_job
from foottrack_service.evaluation.plots import page, recording_pictures
from foottrack_service.evaluation.recorded import recorded_tables
from foottrack_service.evaluation.sections import jobs_of, tables
from foottrack_service.recording.errors import RecordingError
from foottrack_service.simulation.scenario import simulate

PNG = b"\x89PNG\r\n"


def test_ours_is_better_than_the_reference_on_a_walk_it_was_not_tuned_on() -> None:
    errors = {}
    for name in ("reference", "ours"):
        result = run_job(Job("walk", 9173, name, seconds=10.0))
        errors[name] = np.concatenate([foot.errors for foot in result.feet.values()])
        assert len(errors[name]) > 1500
    assert np.mean(errors["ours"]) < 0.5 * np.mean(errors["reference"])
    assert np.max(errors["ours"]) < np.max(errors["reference"])


def test_a_job_is_deterministic() -> None:
    first, second = (run_job(Job("steps", 4, "ours", seconds=4.0)) for _ in range(2))
    for side, foot in first.feet.items():
        assert np.array_equal(foot.errors, second.feet[side].errors)


def test_sections_name_their_runs_and_pool_them() -> None:
    tasks, seeds = ["steps", "still", "walk"], [5, 6]
    assert len(jobs_of("tasks", tasks, seeds)) == 12
    assert {job.only for job in jobs_of("technical", tasks, seeds)} == {"marker", "depth", "inertial"}
    assert {job.task for job in jobs_of("study", tasks, seeds)} == {"steps"}
    assert all(not job.left_imu for job in jobs_of("study", tasks, seeds))
    assert all(gap_windows(job) for job in jobs_of("gaps", tasks, seeds))
    wanted = [Job("still", seed, name) for seed in seeds for name in ("reference", "ours")]
    short = run_job(Job("still", 5, "ours", seconds=3.0))
    table = tables("tasks", dict.fromkeys(wanted, short), ["still"], seeds)
    assert set(table) == {"still"}
    assert set(table["still"]) == {"reference", "ours", "smoother", "published"}
    assert {"mean", "median", "p95", "max", "lag"} <= set(table["still"]["ours"])
    assert table["still"]["published"]["mean"] == 2.96


def test_the_technical_test_takes_the_pictures_away() -> None:
    dark = run_job(Job("still", 2, "ours", seconds=6.0, only="inertial"))
    assert dark.accepted.get("depth", 0) == 0
    assert dark.accepted["marker"] < 2 * 60 * 4


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("evaluate") / "line.mcap"
    settings = Settings()
    write_recording(simulate("line", 8, settings=settings, seconds=4.0), settings, file)
    return file


def test_a_recording_with_truth_is_evaluated(recording: Path) -> None:
    row = recorded_tables(recording)
    assert set(row) == {"reference", "ours"}
    assert 0.0 < row["ours"]["mean"] < 60.0


def test_a_recording_s_pictures_and_page(recording: Path) -> None:
    pictures = recording_pictures(recording)
    assert set(pictures) == {"line-left.png", "line-right.png"}
    assert all(png.startswith(PNG) for png in pictures.values())
    text = page("a < b", pictures)
    assert "a &lt; b" in text and text.count("data:image/png") == 2


def test_a_recording_without_truth_says_so(tmp_path: Path) -> None:
    bare = tmp_path / "imu.mcap"
    settings = Settings()
    scenario = simulate("line", 8, settings=settings, seconds=2.0)
    only_imu = tuple(emission for emission in scenario.emissions if emission.stream.startswith("imu/"))
    write_recording(type(scenario)(**{**scenario.__dict__, "emissions": only_imu}), settings, bare)
    with pytest.raises(RecordingError, match="truth"):
        recorded_tables(bare)


def test_evaluate_json_on_a_recording(recording: Path) -> None:
    result = CliRunner().invoke(app, ["evaluate", str(recording), "--json"])
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    assert {"mean", "median", "p95", "max", "lag"} <= set(found["tasks"]["line"]["ours"])


def test_faults_in_tasks_that_have_none_are_said_instead_of_nothing_shown() -> None:
    result = CliRunner().invoke(app, ["evaluate", "--sections", "faults", "--tasks", "steps"])
    assert isinstance(result.exception, CommandFailed)
    assert result.exception.code == EXIT_USAGE
    assert "walk-in-place" in str(result.exception)
