"""Settings: the layers, where each value came from, and what is wrong said with its place."""

import re
from pathlib import Path

import pytest

from foottrack_service import config
from foottrack_service.cli.settings import commented
from foottrack_service.config import BusSettings, ConfigError, Settings


def write(folder: Path, text: str) -> Path:
    file = folder / "settings.toml"
    file.write_text(text)
    return file


def test_layers_go_before_each_other(tmp_path, monkeypatch):
    file = write(tmp_path, "[body]\nheight = 1.6\nthigh = 0.4\nshank = 0.41\n[feet.left]\nankle_height = 0.1\n")
    monkeypatch.setenv("FOOTTRACK_BODY__THIGH", "0.45")
    monkeypatch.setenv("FOOTTRACK_DATA", "/somewhere")
    loaded = config.load(
        file, flags={"user": "anna"}, calibration={"body": {"thigh": 0.5, "shank": 0.42, "torso": 0.6}}
    )
    body = loaded.settings.body
    assert (body.height, body.shank, body.torso) == (1.6, 0.42, 0.6)
    assert (body.thigh, loaded.settings.user) == (0.45, "anna")
    assert loaded.origins == {
        "body.height": str(file),
        "feet.left.ankle_height": str(file),
        "body.thigh": "environment",
        "body.shank": "calibration",
        "body.torso": "calibration",
        "user": "flag",
    }


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[body]\nheihgt = 1.6\n", "body.heihgt"),
        ("[body]\nheight = -1\n", "body.height"),
        ("[body]\nheight = nan\n", "body.height"),
        ("[feet.left]\nmarker = { q = [0.0, 0.0, 0.0, 2.0] }\n", "feet.left.marker.q"),
        ('user = "Anna!"\n', "user"),
        ("body = 5\n", "body"),
        ("[body\n", "not TOML"),
    ],
)
def test_what_is_wrong_names_its_place(tmp_path, text, place):
    with pytest.raises(ConfigError, match=place):
        config.load(write(tmp_path, text))


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(ConfigError, match=r"nothing\.toml"):
        config.load(tmp_path / "nothing.toml")


def test_a_table_that_says_a_part_leaves_the_rest_at_its_default(tmp_path):
    loaded = config.load(write(tmp_path, "[camera.mount]\np = [0.0, 0.01, -0.07]\n[feet.left.marker]\n")).settings
    default = Settings()
    assert loaded.camera.mount.p == (0.0, 0.01, -0.07)
    assert loaded.camera.mount.q == default.camera.mount.q
    assert loaded.feet == default.feet


def test_the_written_settings_file_changes_nothing_commented_or_not(tmp_path):
    text = commented(Settings())
    assert config.load(write(tmp_path, text)).settings == Settings()
    uncommented = re.sub(r"^# (\[.*\]|\w+ = (?!\.\.\.).*)$", r"\1", text, flags=re.MULTILINE)
    assert uncommented.count("\n# ") < text.count("\n# ") - 100
    loaded = config.load(write(tmp_path, uncommented))
    assert loaded.settings == Settings()
    assert len(loaded.origins) > 100


def test_toml_round_trip_keeps_every_bit():
    settings = Settings(body={"height": 1.7000000000000002}, fusion={"filter": "reference"}, user="bo-1")
    assert config.from_toml(config.to_toml(settings)) == settings
    assert config.from_toml(config.to_toml(settings)).digest == settings.digest


def test_a_recording_s_unknown_settings_are_left_out_with_a_warning(caplog):
    text = config.to_toml(Settings(body={"height": 1.5})) + "\n[gone]\nx = 1\n\n[body.old]\ny = 2\n"
    assert config.from_toml(text).body.height == 1.5
    assert "gone" in caplog.text and "body.old" in caplog.text


def test_a_recording_s_wrong_settings_are_an_error():
    with pytest.raises(ConfigError, match=r"body\.height"):
        config.from_toml('[body]\nheight = "tall"\n')


@pytest.mark.parametrize("where", ["7801", "127.0.0.1:7801", "tcp://127.0.0.1:7801"])
def test_three_ports_in_a_row(where):
    found = BusSettings.beginning_at(where)
    assert (found.ingress, found.egress, found.control) == tuple(
        f"tcp://127.0.0.1:{port}" for port in (7801, 7802, 7803)
    )


@pytest.mark.parametrize("where", ["", "tcp://127.0.0.1", "70000", "here:there"])
def test_no_address_is_refused(where):
    with pytest.raises(ConfigError, match="no address"):
        BusSettings.beginning_at(where)


def test_a_mount_s_hash_changes_with_the_mount():
    moved = Settings(camera={"mount": {"p": [0.0, 0.01, -0.08]}})
    assert moved.camera.mount_hash != Settings().camera.mount_hash


def test_a_mount_under_headset_is_told_its_place(tmp_path):
    file = write(tmp_path, "[headset.camera]\np = [0.0, 0.0, -0.08]\n")
    with pytest.raises(ConfigError, match=r"where the camera sits on the headset is \[camera\] mount"):
        config.load(file)
