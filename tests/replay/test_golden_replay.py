"""Small recordings through offline replay, compared with the results that are kept beside them."""

from __future__ import annotations

from pathlib import Path

import pytest
from golden import FOLDER, check_golden

from foottrack_service.cli.offline import replay_offline, results_of, settings_of
from foottrack_service.recording.reader import open_recording

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
