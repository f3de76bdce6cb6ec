"""``foottrack calibrate headset`` on a recording."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

from foottrack_service.cli.calibrate import app
from foottrack_service.cli.sim import write_recording
from foottrack_service.config import Settings
from foottrack_service.simulation.scenario import simulate


def test_a_recording_tells_the_latency(tmp_path: Path) -> None:
    settings = Settings()
    write_recording(simulate("head-moving", 1, settings=settings, seconds=8.0), settings, tmp_path / "looks.mcap")
    done = CliRunner().invoke(app, ["headset", str(tmp_path / "looks.mcap"), "--json"])
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert set(found) == {"seconds", "sigma", "spread"}
    assert abs(found["seconds"]) < 0.003
