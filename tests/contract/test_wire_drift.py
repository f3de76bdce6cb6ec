"""What is generated is as it would be generated now."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from foottrack_protocol.generate import COMMAND, FOLDER, GENERATED, SpecError, drift, with_tables, write


def test_generated_files_are_up_to_date() -> None:
    changes = drift()
    assert not changes, "\n".join([*changes, f"Run: {COMMAND}   (or: make schemas)"])


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    shutil.copy(FOLDER / "SPEC.md", tmp_path)
    for name in GENERATED:
        shutil.copytree(FOLDER / name, tmp_path / name)
    return tmp_path


def test_drift_is_noticed_and_mended(copy: Path) -> None:
    (copy / "schema" / "imu.json").write_text("{}", encoding="utf-8")
    (copy / "schema" / "old.json").write_text("{}", encoding="utf-8")
    (copy / "vectors" / "imu.json").unlink()
    spec = copy / "SPEC.md"
    whole = spec.read_text(encoding="utf-8")
    spec.write_text(whole.replace("| `acc` |", "| `accel` |"), encoding="utf-8")
    expected = {
        "SPEC.md is out of date",
        "schema/imu.json is out of date",
        "schema/old.json is not generated any more",
        "vectors/imu.json is missing",
    }
    assert set(drift(copy)) == expected
    assert set(write(copy)) == expected
    assert drift(copy) == []
    assert spec.read_text(encoding="utf-8") == whole


def test_a_marker_that_is_missing_or_unknown_is_an_error() -> None:
    spec = (FOLDER / "SPEC.md").read_text(encoding="utf-8")
    with pytest.raises(SpecError, match="limits"):
        with_tables(spec.replace("<!-- generated: limits -->", ""))
    with pytest.raises(SpecError, match="nobody"):
        with_tables(spec.replace("<!-- generated: limits -->", "<!-- generated: nobody -->"))


def test_the_command_line_checks() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "foottrack_protocol.generate", "--check"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
