"""The example's scene beside `foottrack demo`: the avatar's feet go where the simulated person's feet go."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from client_traffic import ports
from free_ports import three_free_ports
from godot_project import GodotProject

from foottrack_client import Endpoints

pytestmark = [pytest.mark.engine, pytest.mark.slow]
SAMPLES = 240
LIFT_M = 0.08
"""Walking in place lifts each foot by a hand's breadth."""


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Endpoints]:
    """A demo that goes on for longer than the test looks, with cheap pictures."""
    main = "from foottrack_service.cli.main import main; main()"
    ends = Endpoints.beginning_at(f"tcp://127.0.0.1:{three_free_ports()}")
    options = ("--listen", ends.ingress, "--camera", "simulated", "--seconds", "60")
    command = [sys.executable, "-c", main, "demo", *options]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    try:
        assert process.stderr is not None
        assert any("publishers on" in line for line in process.stderr)
        yield ends
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
def test_the_avatar_s_feet_go_where_the_person_s_do(godot: GodotProject, demo: Endpoints) -> None:
    with godot.start("demo.gd", {**ports(demo), "samples": SAMPLES, "lift": LIFT_M}) as run:
        said = run.until("moved")
    assert 0.7 < said["scale"] < 1.3
    for side, samples in said["feet"].items():
        shown = np.array([each[1] for each in samples])
        told = np.array([each[2] for each in samples])
        # The avatar's ankle sits higher or lower above its sole; legs may be stretched for a moment.
        away = np.linalg.norm(shown - told - np.median(shown - told, axis=0), axis=1)
        assert np.median(away) < 0.002, side
        assert np.percentile(away, 80) < 0.02, side
