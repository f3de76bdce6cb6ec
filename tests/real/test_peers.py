"""Peers' methods, as we run them, reach what their makers publish."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from foottrack_service.evaluation import datasets, peers, real

DATA = Path(os.environ.get("FOOTTRACK_DATA", Path(__file__).parents[3] / "shared" / "data"))
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings are not here (FOOTTRACK_DATA)"),
]


@pytest.mark.parametrize("name", real.PUBLISHED_RETURN_MM)
def test_imufusion_with_zero_velocity_ends_where_its_makers_do(name: str) -> None:
    trial = datasets.xio(DATA / "xio_gait" / f"{name.removeprefix('xio ')}.csv")
    places = peers.ahrs_with_zero_velocity(trial.t, trial.acc, trial.gyro, real.XIO_HZ)
    assert 1e3 * np.linalg.norm(places[-1]) == pytest.approx(real.PUBLISHED_RETURN_MM[name], abs=2.0)


@pytest.mark.slow
def test_the_table_of_real_recordings(tmp_path: Path) -> None:
    # All of it takes half a minute: one of the runs stands for the nine.
    for name in ("gaitmap", "xio_gait"):
        shutil.copytree(DATA / name, tmp_path / name)
    run = "2017-11-27-11-13-41.npz"
    (tmp_path / "llio_pyshoe_vicon_dev").mkdir()
    shutil.copy(DATA / "llio_pyshoe_vicon_dev" / run, tmp_path / "llio_pyshoe_vicon_dev" / run)
    begun: list[str] = []
    tables = real.real_tables(tmp_path, begun.append)
    assert len(begun) == 4
    tracks, returns, strides = tables["tracks"], tables["returns"], tables["strides"]
    median = tracks["median"]
    assert median["ours"] < 0.3 < median["learned detector (pyshoe)"] < 0.45 < median["reference"]
    for row in returns.values():
        assert abs(row["ours, height"]) < 10.0
        assert row["ours, plane"] < row["imufusion, plane"]
    assert [(row["strides"], row["found, ours"]) for row in strides.values()] == [(28.0, 28.0), (29.0, 29.0)]
    for row in strides.values():
        assert row["ours, mm"] < 50.0
        assert row.get("RtsKalman (gaitmap), mm", 50.0) == pytest.approx(50.0, abs=5.0)
