"""Real foot IMUs through our filter, inertial only, forward only, one configuration for all (data: see its README)."""

from __future__ import annotations

import numpy as np
import pytest
from inertial_recordings import DATA, gaitmap_strides, vicon_rmse, xio_end_error

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings are not here (FOOTTRACK_DATA)"),
]


def test_walks_and_runs_against_motion_capture() -> None:
    errors = [vicon_rmse(file) for file in sorted((DATA / "llio_pyshoe_vicon_dev").glob("*.npz"))]
    assert len(errors) == 9
    assert np.median(errors) < 0.07
    assert max(errors) < 0.2


@pytest.mark.parametrize(("walk", "plane"), [("short_walk", 0.05), ("long_walk", 0.085)])
def test_walks_end_where_they_began(walk: str, plane: float) -> None:
    # 0.1 % of the gyro's scale alone moves these ends by 25 and 62 mm, 0.05 deg/s per g by 19 and 65; and in the short
    # walk the foot ends turned by 21 deg: what came back exactly lies 0.1 m behind the sensor.
    in_plane, height = xio_end_error(walk)
    assert in_plane < plane
    assert abs(height) < 0.01


def test_stride_lengths_against_the_heel() -> None:
    errors, found = (np.concatenate(both) for both in zip(*map(gaitmap_strides, ("left", "right")), strict=True))
    assert len(errors) == 57
    assert found.all()
    assert np.sqrt(np.mean(errors**2)) < 0.05
