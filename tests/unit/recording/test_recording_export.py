"""JSON lines and CSV."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import msgpack
import pytest
from recording_samples import frames

from foottrack_service.recording.export import CsvTables, to_json, write_jsonl
from foottrack_service.recording.reader import Frame


def test_a_line_of_json_is_the_message() -> None:
    frame = frames(1)[0]
    value = json.loads(to_json(frame))
    assert (value.pop("topic"), value.pop("log_time")) == ("user/imu/left", frame.arrival)
    assert value == msgpack.unpackb(frame.payload)


def test_lines_are_as_many_as_messages() -> None:
    out = io.StringIO()
    assert write_jsonl(frames(12), out) == 12
    assert len(out.getvalue().splitlines()) == 12


def test_bytes_are_base64_in_json() -> None:
    frame = Frame(1, b"user/raw/camera", msgpack.packb({"data": {"jpeg": b"\x00\xff"}}))
    assert json.loads(to_json(frame))["data"]["jpeg"] == "AP8="


def tables(folder: Path, content: list[Frame]) -> dict[str, list[dict[str, str]]]:
    made = CsvTables(folder)
    made.learn(content)
    assert made.write(content) == len(content)
    found = {}
    for path in folder.iterdir():
        with path.open(newline="", encoding="utf-8") as file:
            found[path.name] = list(csv.DictReader(file))
    return found


def test_csv_has_a_table_a_topic_and_every_digit(tmp_path: Path) -> None:
    content = frames(40)
    found = tables(tmp_path / "out", content)
    assert set(found) == {"user_imu_left.csv", "user_imu_right.csv", "user_head_pose.csv", "user_marker_left.csv"}
    row, envelope = found["user_imu_left.csv"][3], msgpack.unpackb(content[12].payload)
    assert int(row["log_time"]) == content[12].arrival
    assert [float(row[f"data.acc.{axis}"]) for axis in "xyz"] == envelope["data"]["acc"]
    assert row["seq"] == "3"
    assert [float(found["user_head_pose.csv"][0][f"data.q.{axis}"]) for axis in "xyzw"] == [0.0, 0.6, 0.0, 0.8]
    assert float(found["user_marker_left.csv"][0]["data.cov.zz"]) == 4e-6


def test_a_column_that_only_some_messages_have_is_empty_in_the_others(tmp_path: Path) -> None:
    content = [Frame(n, b"u/x", msgpack.packb({"a": a})) for n, a in enumerate(({"p": None}, {"p": [1.0, 2.0]}))]
    rows = tables(tmp_path / "out", content)["u_x.csv"]
    assert [row["a.p.0"] for row in rows] == ["", "1.0"]


def test_an_older_table_is_not_overwritten(tmp_path: Path) -> None:
    tables(tmp_path / "out", frames(4))
    made = CsvTables(tmp_path / "out")
    made.learn(frames(4))
    with pytest.raises(FileExistsError):
        made.write(frames(4))
