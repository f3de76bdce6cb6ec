"""Results outlive the service: whole or not at all, per user and per shoe."""

from __future__ import annotations

import json
import logging

import pytest

from foottrack_protocol import messages as m
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.calibration.store import FOLDER_VARIABLE, Store, StoreError
from foottrack_service.cli.running import settings_for
from foottrack_service.config import load

BODY = m.BodyCalibration(
    values=m.BodyValues(height=1.81, thigh=0.44, shank=0.45, torso=0.72, hip_width=0.18, hip_back=0.07)
)
FLOOR = m.FloorCalibration(values=m.FloorValues(height=0.031))
HEADING = m.HeadingCalibration(values=m.HeadingValues(yaw=0.1))


def imu(side="left", x=0.01):
    values = m.ImuValues(side=side, acc_bias=(0.1, 0, 0), gyro_bias=(0, 0, 0), p=(x, 0, 0), q=(0, 0, 0, 1))
    return m.ImuCalibration(values=values)


def test_what_is_kept_is_loaded_and_an_older_result_replaced(tmp_path) -> None:
    store = Store(tmp_path, "anna", "boots")
    assert store.load() == []
    for body in (FLOOR, BODY, imu(), imu("right"), m.FloorCalibration(values=m.FloorValues(height=0.04)), imu(x=0.02)):
        store.keep(body)
    kept = Store(tmp_path, "anna", "boots").load()
    assert BODY in kept and imu(x=0.02) in kept and imu("right") in kept
    assert [body.values.height for body in kept if body.kind == "floor"] == [0.04]
    assert len(kept) == 4


def test_a_heading_is_not_kept(tmp_path) -> None:
    store = Store(tmp_path, "anna", "boots")
    store.keep(HEADING)
    assert store.load() == []


def test_users_and_shoes_are_kept_apart(tmp_path) -> None:
    Store(tmp_path, "anna", "boots").keep(BODY)
    Store(tmp_path, "anna", "boots").keep(imu())
    assert Store(tmp_path, "bert", "boots").load() == []
    assert Store(tmp_path, "anna", "sandals").load() == [BODY]


@pytest.mark.parametrize("text", ["{", "[]", '{"user": []}', '{"shoes": {"boots": 3}}', "\xff\x00", '{"user": 1}'])
def test_a_broken_file_is_said_and_left_out(tmp_path, caplog, text) -> None:
    store = Store(tmp_path, "anna", "boots")
    store.path.write_text(text, encoding="latin-1")
    with caplog.at_level(logging.WARNING):
        assert store.load() == []
    assert "anna.json" in caplog.text
    store.keep(FLOOR)
    assert store.load() == [FLOOR]


def test_what_is_broken_is_said_once_however_often_it_is_looked_at(tmp_path, caplog) -> None:
    store = Store(tmp_path, "anna", "boots")
    store.path.write_text('{"user": {"body": {"kind": "body", "values": {}}}}')
    for _ in range(5):
        store.load()
    assert len(caplog.records) == 1
    store.path.write_text("no JSON")
    for _ in range(5):
        store.load()
    assert len(caplog.records) == 2


def test_one_broken_entry_does_not_spoil_the_others(tmp_path, caplog) -> None:
    store = Store(tmp_path, "anna", "boots")
    store.keep(FLOOR)
    store.keep(BODY)
    kept = json.loads(store.path.read_text())
    kept["user"]["body"]["values"]["thigh"] = "long"
    store.path.write_text(json.dumps(kept))
    assert store.load() == [FLOOR]
    assert "body" in caplog.text


def test_a_write_that_fails_leaves_the_old_file_and_no_rest(tmp_path, monkeypatch) -> None:
    store = Store(tmp_path, "anna", "boots")
    store.keep(FLOOR)
    before = store.path.read_bytes()

    def full(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(StoreError, match="No space left"):
        store.keep(BODY)
    assert store.path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [store.path]


def test_settings_take_what_was_kept_below_flags_and_environment(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "foottrack.toml").write_text('user = "anna"\n[body]\nheight = 1.6\n[feet]\nshoes = "boots"\n')
    Store.at_home("anna", "boots").keep(BODY)
    Store.at_home("anna", "boots").keep(imu())
    settings = settings_for(None)
    assert Skeleton.of(settings.body) == Skeleton.calibrated(BODY.values)
    assert settings.feet.left.imu.p == (0.01, 0.0, 0.0)
    assert settings.feet.right.imu.p == (0.0, 0.0, 0.0)
    assert load(None, calibration=Store.at_home("anna", "boots").layer()).origins["body.height"] == "calibration"
    monkeypatch.setenv("FOOTTRACK_BODY__HEIGHT", "1.7")
    assert settings_for(None).body.height == 1.7
    assert settings_for(None, user="bert").body.height == 1.7
    monkeypatch.delenv("FOOTTRACK_BODY__HEIGHT")
    assert settings_for(None, user="bert").body.height == 1.6
