"""The gait on real recordings: motion capture's events, counted strides, a headset alone."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from foottrack_service.evaluation.gait_real import corridor_strides, gaitmap_events, quest_cadence

DATA = Path(os.environ.get("FOOTTRACK_DATA", Path(__file__).parents[3] / "shared" / "data"))

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings are not here (FOOTTRACK_DATA)"),
]


def test_gaitmap_no_stride_is_missed_and_its_events_are_where_they_should_be():
    found = gaitmap_events(DATA / "gaitmap")
    assert sum(feet.strikes.true for feet in found.values()) == 57
    for feet in found.values():
        assert feet.strikes.found == feet.strikes.true
        assert feet.toe_offs.found == feet.toe_offs.true
        assert np.std(feet.strikes.errors) < 0.025
        assert np.std(feet.toe_offs.errors) < 0.025
        # The list leaves out first, last and turning swings; the heel's marker does not.
        assert feet.missed_swings <= 1
    assert sum(feet.extra_swings for feet in found.values()) <= 1


@pytest.mark.parametrize(
    "number",
    [34, *(pytest.param(n, marks=pytest.mark.slow) for n in (36, 39, 40, 45))],
)
def test_corridor_walks_have_the_strides_that_were_counted(number):
    true, found = corridor_strides(DATA / "llio_corridor_dev" / f"SensorConnectData_{number}.npz")
    assert found == true


def test_a_headset_alone_steps_at_the_pace_of_its_bob():
    windows = quest_cadence(DATA / "quest_wip" / "walkInPlace_001_runningAround.oqrec")
    errors = [abs(pair[0] - pair[1]) for pair in windows if pair is not None]
    assert len(errors) >= 11
    assert max(errors) <= 0.1
