"""``foottrack walk``: what it writes, and that it writes nothing when something is wrong."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest
from bus_traffic import answering
from typer.testing import CliRunner

from foottrack_service.bus import Broker, Bus
from foottrack_service.bus.endpoints import Context
from foottrack_service.cli import walk_files
from foottrack_service.cli.walk import app
from foottrack_service.config import BusSettings, Settings
from foottrack_service.recording.reader import read
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.path import parse_path
from foottrack_service.walkcycle.presets import preset
from foottrack_service.walkcycle.report import measure_all, table
from foottrack_service.walkcycle.walk import walk_along


def run_walk(*words: str) -> Any:
    return CliRunner().invoke(app, list(words))


@pytest.mark.parametrize("ending", [".bvh", ".glb", ".mcap", ".json"])
def test_the_ending_chooses_the_format(tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"walk{ending}"
    result = run_walk("along", "animator", "--path", "circle:2,90", "--out", str(out), "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["seconds"] > 2.0
    start = {".bvh": b"HIERARCHY", ".glb": b"glTF", ".mcap": b"\x89MCAP0", ".json": b"{"}[ending]
    assert out.read_bytes().startswith(start)
    assert [file.name for file in tmp_path.iterdir()] == [out.name]


def test_lees_own_demonstration_eight_steps_on_a_curve(tmp_path: Path) -> None:
    out = tmp_path / "eight.bvh"
    result = run_walk("along", "normative", "--path", "s:8", "--steps", "8", "--out", str(out), "--json")
    # The ninth closes the feet.
    assert json.loads(result.stdout)["steps"] == 9


def test_a_project_goes_the_whole_way(tmp_path: Path) -> None:
    mine, baked, walk, loop = (str(tmp_path / name) for name in ("mine.json", "baked.json", "walk.glb", "loop.bvh"))
    for words in (
        ("new", "animator", "--bounce", "0.09", "--toe-out", "8", "--speed", "1.2", "--out", mine),
        ("cycle", mine, "--bake", "24", "--out", baked),
        ("along", baked, "--path", "corner:2", "--height", "1.6", "--out", walk),
        ("export", mine, "--out", loop),
        ("plot", mine, "--path", "circle:1,180", "--out", str(tmp_path / "pictures")),
    ):
        result = run_walk(*words)
        assert result.exit_code == 0, result.output
    shown = json.loads(run_walk("show", mine, "--json").stdout)
    assert shown["speed_m_s"] == pytest.approx(1.2, abs=0.01)
    pictures = sorted(file.name for file in (tmp_path / "pictures").iterdir())
    assert pictures == ["angles.png", "arcs.png", "footprints.png", "poses.png"]
    assert "poses" in run_walk("show", mine).stdout
    assert "keys" in json.loads(run_walk("show", mine, "--schema").stdout)["properties"]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("along", "normative", "--path", "line:0.3"), "shorter than one step"),
        (("along", "normative", "--path", "moon"), "moon"),
        (("along", "jog"), "'jog'"),
        (("along", "missing.json"), "missing.json"),
        (("along", "normative", "--steps", "90"), "90 steps"),
        (("along", "normative", "--height", "9"), "height"),
        (("along", "normative", "--speeds", "fast"), "'fast'"),
        (("along", "normative", "--speeds", "0:9"), "factors"),
        (("along", "normative", "--step-length", "2"), "out of reach"),
        (("along", "normative", "--steps", "2", "--seconds", "3"), "not both"),
        (("along", "sneak", "--step-length", "1.0", "--path", "line:5"), "out of the leg's reach"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(tmp_path: Path, words: tuple[str, ...], named: str) -> None:
    out = tmp_path / "walk.bvh"
    result = run_walk(*words, "--out", str(out))
    assert result.exit_code == 2, result.output
    assert named in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_project_without_toes_names_the_pose(tmp_path: Path) -> None:
    mine = tmp_path / "mine.json"
    assert run_walk("new", "animator", "--out", str(mine)).exit_code == 0
    data = json.loads(mine.read_text())
    del data["keys"][1]["pose"]["right"]["toe"]
    mine.write_text(json.dumps(data))
    result = run_walk("along", str(mine), "--out", str(tmp_path / "walk.glb"))
    assert result.exit_code == 2
    assert "mine.json" in result.stderr
    assert "keys.1 (down).pose.right.toe" in result.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["mine.json"]


@pytest.mark.parametrize("ending", [".bvh", ".glb"])
def test_show_reads_a_written_motion_and_names_where_it_is_broken(tmp_path: Path, ending: str) -> None:
    walk = tmp_path / f"walk{ending}"
    run_walk("along", "sneak", "--path", "line:3", "--fps", "30", "--out", str(walk))
    held = json.loads(run_walk("show", str(walk), "--json").stdout)
    assert held["joints"] == 22
    assert held["frames"] >= 30.0 * held["seconds"]
    refused = run_walk("along", str(walk), "--out", str(tmp_path / "again.bvh"))
    assert refused.exit_code == 2
    assert "key poses are in a project" in refused.stderr
    # A number among the frames, or a byte of the header.
    walk.write_bytes(walk.read_bytes()[:-4].rstrip() + b" x" if ending == ".bvh" else b"glTX" + walk.read_bytes()[4:])
    broken = run_walk("show", str(walk))
    assert broken.exit_code == 2
    assert f"{walk}: {'BVH line ' if ending == '.bvh' else 'GLB: '}" in broken.stderr
    assert [file.name for file in tmp_path.iterdir()] == [walk.name]


@pytest.mark.parametrize("ending", [".txt", ".fbx", ""])
def test_an_unknown_ending_is_refused(tmp_path: Path, ending: str) -> None:
    result = run_walk("along", "normative", "--out", str(tmp_path / f"walk{ending}"))
    assert result.exit_code == 2
    assert ".bvh, .glb, .mcap, .json" in result.stderr


def test_every_command_has_help_with_an_example() -> None:
    for command in ("new", "show", "cycle", "along", "play", "export", "plot", "measure"):
        result = run_walk(command, "--help")
        assert result.exit_code == 0
        assert f"foottrack walk {command}" in " ".join(result.stdout.split())


def test_a_recording_holds_the_streams_of_a_person(tmp_path: Path) -> None:
    out = tmp_path / "walk.mcap"
    assert run_walk("along", "sneak", "--path", "line:2", "--out", str(out)).exit_code == 0
    messages = [recorded.message for recorded in read(out)]
    streams = {message.stream for message in messages}
    assert streams == {"pose/body", "pose/ik", "gait/state", "gait/event"}
    assert [m.t for m in messages] == sorted(m.t for m in messages)
    for stream in streams:
        assert [m.seq for m in messages if m.stream == stream] == list(range(sum(m.stream == stream for m in messages)))
    assert run_walk("along", "sneak", "--path", "line:2", "--out", str(out)).exit_code == 2


def test_a_walk_plays_on_a_running_bus(broker: Broker, context: Context, run: Any) -> None:
    walk = walk_along(build_cycle(preset("normative")), parse_path("line:0.8"), 1)

    async def listen() -> tuple[int, list[str]]:
        async with answering(broker) as ends:
            with Bus.connect(ends, context) as bus:
                return await heard_by(bus, Settings(bus=ends))

    async def heard_by(bus: Bus, settings: Settings) -> tuple[int, list[str]]:
        subscriber = bus.subscriber(["user/"])
        try:
            await subscriber.ready()
            playing = asyncio.create_task(walk_files.play_walk(walk, settings, 60.0))
            heard: list[str] = []
            async for batch in subscriber.batches():
                heard += [received.message.stream for received in batch]
                if playing.done() and len(heard) >= playing.result():
                    break
            return await playing, heard
        finally:
            subscriber.close()

    sent, heard = run(listen())
    assert sent == len(heard)
    assert heard.count("pose/body") == heard.count("pose/ik") == heard.count("gait/state") == len(walk.times(60.0))
    assert heard.count("gait/event") >= 10


def test_without_a_bus_play_says_so() -> None:
    settings = BusSettings.beginning_at("tcp://127.0.0.1:1")
    assert settings.ingress.endswith(":1")
    result = run_walk("play", "normative", "--path", "line:0.8", "--connect", "tcp://127.0.0.1:1")
    assert result.exit_code == 1
    assert "no bus answers" in result.stderr


def test_measure_reports_figures_as_one_object() -> None:
    figures = json.loads(run_walk("measure", "normative", "--path", "line:3", "--json").stdout)
    assert figures["frames_per_s"] > 0.0
    walk = figures["walks"]["normative"]["walks"]["line:3"]
    assert walk["generator"]["slip_mm"] < 0.01
    assert walk["bvh_60"]["keys"]["slip_mm"] < 0.1
    assert walk["glb_60"]["between"]["slip_mm"] < 0.5
    assert walk["bvh_60"]["round_trip_mm"] < 0.01
    assert "line:3" in run_walk("measure", "normative", "--path", "line:3").stdout


def test_the_table_ends_with_the_worst_of_all_walks() -> None:
    figures = measure_all([preset("sneak"), preset("normative")], ["line:2", "line:0.1"])
    assert "shorter" in figures["sneak"]["walks"]["line:0.1"]["error"]
    lines = table(figures).splitlines()
    worst = lines.index("worst of these 2 walks:")
    most = max(figures[name]["walks"]["line:2"]["bvh_30"]["between"]["slip_mm"] for name in figures)
    assert any(line.split()[0] == "bvh_30" and f"between slip {most:.3g} mm" in line for line in lines[worst + 1 :])
