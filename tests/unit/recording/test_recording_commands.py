"""``foottrack log``: what it says, as text and as JSON, and how it ends."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from recording_samples import CONFIG, frames, frames_of, write
from typer.testing import CliRunner

from foottrack_service.cli.log import app
from foottrack_service.cli.log_text import show_info
from foottrack_service.cli.running import CommandFailed
from foottrack_service.recording.info import RecordingInfo, TopicInfo
from foottrack_service.recording.reader import open_recording


def log(*arguments: object) -> tuple[int, str]:
    """Exit code and output; a failure's text is its one line."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if isinstance(result.exception, CommandFailed):
        return result.exception.code, str(result.exception)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout


def log_json(*arguments: object) -> tuple[int, Any]:
    code, text = log(*arguments, "--json")
    return code, json.loads(text)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write(tmp_path / "a.mcap", frames(400), chunk=100)


def test_info(recording: Path) -> None:
    code, text = log("info", recording)
    assert code == 0
    assert "400 messages in 0.4 s" in text
    assert "user/imu/left" in text
    code, values = log_json("info", recording)
    assert code == 0
    assert values["messages"] == 400
    assert values["topics"]["user/imu/left"]["hz"] == pytest.approx(250.0)
    assert values["has_config"] is True


@pytest.mark.parametrize("width", [40, 80, 200])
def test_info_cuts_no_name_and_no_number_however_narrow_the_terminal(
    width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    name = "somebody-with-a-rather-long-name/raw/imu/right"
    topic = TopicInfo(1234567, lost=120345, invalid=7, last=10**12, longest_gap_s=12.3, sources=["imu-right"])
    show_info(RecordingInfo("a.mcap", "mcap", 10**6, messages=1234567, topics={name: topic}))
    shown = capsys.readouterr().out
    assert f"{name} " in shown
    assert "1234567" in shown
    assert ("120345" in shown) == (width >= 80)
    assert ("imu-right" in shown) == (width >= 200)


def test_cat_picks_topics_and_times(recording: Path) -> None:
    code, text = log("cat", recording, "--topic", "user/imu/left", "--from", "0.1", "--to", "0.108")
    assert code == 0
    assert [line.split()[:3] for line in text.splitlines()] == [
        ["0.100000", "user/imu/left", "25"],
        ["0.104000", "user/imu/left", "26"],
        ["0.108000", "user/imu/left", "27"],
    ]
    code, text = log("cat", recording, "-t", "user/head", "-t", "user/marker", "--to", "0.01", "--json")
    assert [json.loads(line)["topic"] for line in text.splitlines()] == ["user/head/pose", "user/marker/left"] * 2 + [
        "user/head/pose"
    ]


def test_export_and_import_bring_back_every_byte(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(CONFIG)
    code, values = log_json("export", recording, "--out", tmp_path / "a.msgpack")
    assert (code, values["messages"]) == (0, 400)
    code, values = log_json("import", tmp_path / "a.msgpack", "--out", tmp_path / "b.mcap", "-c", tmp_path / "c.toml")
    assert (code, values["messages"]) == (0, 400)
    assert frames_of(tmp_path / "b.mcap") == frames_of(recording)
    assert open_recording(tmp_path / "b.mcap").config_toml == CONFIG
    assert log("diff", recording, tmp_path / "a.msgpack")[0] == 0


@pytest.mark.parametrize(("form", "made"), [("jsonl", "out"), ("csv", "out/user_imu_left.csv")])
def test_export_for_others(recording: Path, tmp_path: Path, form: str, made: str) -> None:
    assert log("export", recording, "-f", form, "-o", tmp_path / "out")[0] == 0
    assert (tmp_path / made).stat().st_size > 1000


def test_export_overwrites_nothing(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("precious")
    code, text = log("export", recording, "-o", tmp_path / "out")
    assert (code, (tmp_path / "out").read_text()) == (1, "precious")
    assert "exists" in text


def test_diff_ends_as_diff_does(recording: Path, tmp_path: Path) -> None:
    other = write(tmp_path / "b.mcap", frames(400, seed=2))
    assert log("diff", recording, recording) == (0, "The same: 400 messages.\n")
    code, text = log("diff", recording, other)
    assert code == 1
    assert text.startswith("First difference: user/imu/left, message 0")
    assert log("diff", recording, other, "--abs", "100")[0] == 0
    assert log("diff", recording, other, "--ignore", "data.*")[0] == 0
    assert log("diff", recording, tmp_path / "absent")[0] == 2
    code, values = log_json("diff", recording, other, "--topic", "user/head")
    assert (code, values["same"], values["compared"]) == (1, False, 100)
    assert (values["first"]["topic"], values["first"]["field"]) == ("user/head/pose", "data.p.0")
    assert log_json("diff", recording, recording)[1]["first"] is None


def test_recover_says_whole_losses_or_nothing(recording: Path, tmp_path: Path) -> None:
    code, text = log("recover", recording, "--out", tmp_path / "b.mcap")
    assert code == 0
    assert "whole" in text
    torn = tmp_path / "torn.mcap.part"
    torn.write_bytes(recording.read_bytes()[:-2000])
    code, values = log_json("recover", torn, "--out", tmp_path / "c.mcap")
    assert code == 3
    assert values["messages"] == len(frames_of(tmp_path / "c.mcap"))
    assert values["damage"]
    torn.write_bytes(recording.read_bytes()[:50])
    assert log("recover", torn, "--out", tmp_path / "d.mcap")[0] == 1
    assert not (tmp_path / "d.mcap").exists()


@pytest.mark.parametrize("command", ["info", "cat"])
def test_damage_is_one_line_with_its_place_and_what_to_do(recording: Path, command: str) -> None:
    data = bytearray(recording.read_bytes())
    data[len(data) // 2] ^= 1
    recording.write_bytes(data)
    code, text = log(command, recording)
    assert code == 1
    assert "byte " in text
    assert "foottrack log recover" in text
    assert "\n" not in text


@pytest.mark.parametrize("command", ["info", "cat"])
def test_a_file_that_is_not_there(tmp_path: Path, command: str) -> None:
    code, text = log(command, tmp_path / "absent.mcap")
    assert code == 1
    assert "absent.mcap" in text


def test_import_refuses_settings_that_are_none(recording: Path, tmp_path: Path) -> None:
    log("export", recording, "--out", tmp_path / "a.msgpack")
    (tmp_path / "c.toml").write_text("[body]\nheigth = 1\n")
    with pytest.raises(Exception, match="heigth"):
        log("import", tmp_path / "a.msgpack", "--out", tmp_path / "b.mcap", "-c", tmp_path / "c.toml")
    assert not (tmp_path / "b.mcap").exists()
