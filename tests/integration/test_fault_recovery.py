"""Nothing poisons it: back within 10 mm in half a second of good measurements, on runs that once took longer."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service.evaluation import fault_recovery as recovery
from foottrack_service.evaluation.fault_cases import FAULT_CASES
from foottrack_service.evaluation.fault_recovery import FaultJob, Recovery
from foottrack_service.simulation.faults import FalseTags
from foottrack_service.simulation.scenario import simulate


@pytest.mark.parametrize(
    ("case", "device", "task", "seed"),
    [
        ("IMU's clock +0.05 s", "raw", "walk", 1001),
        ("IMU's clock +0.25 s", "raw", "walk", 2001),
        ("IMU's clock -0.05 s", "q alone", "walk", 1001),
        ("IMU silent, 2 s", "raw", "walk", 1001),
        ("IMU silent, 2 s", "raw", "walk", 2002),
        ("IMU silent, 2 s", "raw", "walk", 2012),
        ("camera's clock -0.25 s", "BNO08x", "walk", 1001),
        ("camera's clock -0.25 s", "raw", "walk-in-place", 1001),
        ("camera's clock -0.25 s", "q alone", "walk-in-place", 2101),
        ("camera's clock -0.25 s", "q alone", "walk", 2404),
        ("headset's clock +0.25 s", "raw", "walk", 1001),
        ("headset's clock -0.05 s", "raw", "walk", 1001),
        ("swapped sides, 10 s", "raw", "walk", 1001),
        ("a tag on the floor, 1 s", "BNO08x", "walk-in-place", 1001),
    ],
)
def test_is_back_in_time(case: str, device: str, task: str, seed: int) -> None:
    found = recovery.run_fault_job(FaultJob(case, device, task, seed))
    assert len(found) >= len(FAULT_CASES[case].sides)
    assert all(each.back for each in found)
    assert max(each.good_s for each in found) <= recovery.DUE_S


def test_every_fault_has_time_to_heal_before_the_next() -> None:
    for case in FAULT_CASES.values():
        windows = recovery.fault_windows(case.lasts_s, 5)
        assert windows
        assert windows[0][0] >= recovery.FIRST_S
        ends = [end for _, end in windows]
        for end, begin in zip(ends, [*(begin for begin, _ in windows[1:]), recovery.SECONDS], strict=True):
            assert begin - end >= recovery.PAUSE_S


def test_who_comes_back_must_stay() -> None:
    t = np.arange(0.0, 4.0, 0.01)
    assert recovery.returned(t, t >= 2.0, 1.0, 3.5) == pytest.approx(2.0)
    assert recovery.returned(t, (t >= 2.0) & ((t < 2.25) | (t > 2.5)), 1.0, 3.5) == pytest.approx(2.51)
    assert recovery.returned(t, t < 2.0, 2.5, 3.5) is None
    assert recovery.returned(t, t > 3.4, 1.0, 3.5) is None


def test_good_measurements_are_those_of_the_own_tag_that_were_made_after_the_fault() -> None:
    fault = FalseTags(start=2.0, end=4.0, side="left", share=1.0, lies=True)
    run = simulate("head-moving", 3, seconds=5.0, faults=[fault])
    meanwhile, after = (recovery.good_fixes(run, "left", frm, to) for frm, to in ((2.0, 4.0), (4.0, 5.0)))
    assert len(meanwhile) < 0.1 * 2 * 60
    assert 45 < len(after) <= 60
    assert after.min() > 4.0
    assert np.all(np.diff(after) >= 0.0)


def test_the_table_counts_who_never_came_back_as_late() -> None:
    job = FaultJob("NaN", "raw", "walk", 1)
    found = [Recovery(job, "left", 1.0, good, back, 0.02) for good, back in ((0.1, True), (0.6, True), (0.2, False))]
    row = recovery.fault_table(found)["NaN"]["raw"]
    assert row["faults"] == 3
    assert row["late"] == 2
    assert row["worst"] == pytest.approx(0.6)
    assert row["peak"] == pytest.approx(20.0)
    groups = recovery.fault_jobs(["walk", "still"], [1, 2])
    assert len(groups) == 2 * len(recovery.DEVICES)
    assert {each.task for group in groups for each in group} == {"walk"}
