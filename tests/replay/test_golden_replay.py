"""Small recordings through offline replay, compared with the results that are kept beside them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from golden import FOLDER, check_golden

from foottrack_service.cli.offline import replay_offline, results_of, settings_of
from foottrack_service.recording.reader import open_recording

OFFLINE = """
import sys
from pathlib import Path
from foottrack_service.cli.offline import replay_offline

replay_offline(Path(sys.argv[1]), Path(sys.argv[2]), None)
"""
RECORDINGS = sorted(path for path in FOLDER.glob("*.mcap") if not path.name.endswith(".results.mcap"))


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda path: path.stem)
def test_results_are_as_they_were(path: Path, pytestconfig: pytest.Config) -> None:
    recording = open_recording(path)
    results = results_of(recording, settings_of(recording, None), quiet=True)
    check_golden(path.stem, results, pytestconfig.getoption("update_golden"))


@pytest.mark.parametrize("path", RECORDINGS, ids=lambda path: path.stem)
def test_the_same_recording_gives_the_same_bytes(path: Path, tmp_path: Path) -> None:
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    assert replay_offline(path, one, None) > 100
    replay_offline(path, two, None)
    assert one.read_bytes() == two.read_bytes()


def test_kernels_that_are_not_compiled_give_the_same_bytes_in_another_process(tmp_path: Path) -> None:
    path = FOLDER / "walk-in-place.mcap"
    assert settings_of(open_recording(path), None).fusion.filter == "error-state"
    one, two = tmp_path / "one.mcap", tmp_path / "two.mcap"
    replay_offline(path, one, None)
    subprocess.run(
        [sys.executable, "-c", OFFLINE, str(path), str(two)], env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, check=True
    )
    assert one.read_bytes() == two.read_bytes()
