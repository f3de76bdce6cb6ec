"""``foottrack trial`` on a recording: simulated sensors, fused and walked offline."""

import json

import typer
from typer.testing import CliRunner

from foottrack_protocol import encode
from foottrack_service.cli.walkinplace import trial
from foottrack_service.config import Settings, to_toml
from foottrack_service.recording.file import RecordingFile
from foottrack_service.simulation.marching import marching
from foottrack_service.simulation.scenario import simulate


def test_a_recorded_walk_in_place_covers_its_way(tmp_path):
    settings = Settings()
    scenario = simulate("in place", 3, seconds=9.0, camera=False, motion=marching(1.8, 0.15), settings=settings)
    path = tmp_path / "walk.mcap"
    with RecordingFile(path, to_toml(settings), 0) as file:
        for arrival, message in scenario.messages():
            topic, payload = encode(message)
            file.add(topic, payload, arrival, message.t_pub, message.seq)
    app = typer.Typer()
    app.command()(trial)
    args = [str(path), "--countdown", "0", "--json"]
    short = json.loads(CliRunner().invoke(app, [*args, "--distance", "3"]).stdout)
    assert short["finished"] and short["distance_m"] == 3.0
    assert 0.3 < short["mean_speed"] <= short["top_speed"] < 3.5
    assert short["steps"] >= 4
    long = json.loads(CliRunner().invoke(app, [*args, "--distance", "500"]).stdout)
    assert not long["finished"] and long["distance_m"] > 3.0
