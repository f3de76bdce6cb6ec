"""Fixes that are told apart by the truth, and the smoother that bounds every filter from below."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings, Settings
from foottrack_service.evaluation.fixes import FixNotes, centre_px, false_stamps
from foottrack_service.evaluation.jobs import Job, run_job
from foottrack_service.evaluation.run import run_filter
from foottrack_service.evaluation.sections import figures
from foottrack_service.evaluation.smoother import smoothed
from foottrack_service.fusion.interface import HeadSample, OpticalFix
from foottrack_service.rotations import IDENTITY
from foottrack_service.simulation.faults import FalseTags
from foottrack_service.simulation.imu import felt
from foottrack_service.simulation.scenario import simulate


@pytest.mark.parametrize("name", ["error-state", "reference"])
def test_false_tags_are_counted_by_what_became_of_them(name: str) -> None:
    settings = Settings(fusion={"filter": name})
    seen = simulate("still", 4, seconds=6.0, depth=False, faults=[FalseTags(side="left", start=3.0, end=4.0)])
    notes = FixNotes()
    run_filter(seen.messages(), settings, notes.make)
    counts = notes.counts(seen, 1.0)
    assert counts["false"] >= 5
    assert counts["false"] <= len(false_stamps(seen))
    assert counts["good"] > 300
    assert counts["good_lost"] < 0.02 * counts["good"]
    rejected = counts["false_rejected"] / counts["false"]
    assert rejected > 0.9 if name == "error-state" else rejected == 0.0


def test_a_pixel_is_a_pixel() -> None:
    mount = Settings().camera.mount
    head = HeadSample(0, np.zeros(3), IDENTITY)
    plain = Settings(camera={"mount": {"p": mount.p, "q": (0.0, 0.0, 0.0, 1.0)}})
    place = np.array([0.3, -0.4, -2.0]) + np.array(mount.p)
    fix = OpticalFix(0, "marker", place, None, None, np.eye(3), 1.0, 50.0, head, head)
    assert centre_px([fix], plain) == pytest.approx([612.0 * 0.25])


def test_the_smoother_is_exact_without_noise_and_better_than_what_only_knows_the_past() -> None:
    seen = simulate("steps", 6, seconds=6.0)
    track, foot = seen.truth.feet["left"], FootSettings()
    t = np.arange(0.0, 6.0, 0.0025)
    acc = felt(track, foot.imu, t)[0]
    fixes = []
    for at in np.arange(0.5, 5.5, 0.1):
        p, q = track.pose(np.array([at]))
        tag = p[0] + _rotated(q[0], foot.marker.p)
        head = HeadSample(round(at * 1e9), np.zeros(3), IDENTITY)
        fixes.append(OpticalFix(head.t, "marker", tag, None, None, 1e-8 * np.eye(3), 1.0, 50.0, head, head))
    times, ankle = smoothed(t, acc, fixes, 0, track, foot)
    assert len(times) > 1900
    assert np.linalg.norm(ankle - track.pose(times)[0], axis=1).max() < 0.003


def test_the_report_holds_shares_bins_and_the_bound() -> None:
    result = run_job(Job("steps", 5, "ours", seconds=6.0))
    values = figures([result])
    assert values["false_rejected"] is None or 0.0 <= values["false_rejected"] <= 100.0
    assert 0.0 <= values["good_lost"] < 5.0
    assert sum(each["mean"] is not None for each in values["by_centre_px"].values()) >= 2
    bound = np.concatenate([foot.smoothed for foot in result.feet.values()])
    assert len(bound) > 500
    assert 1e3 * np.percentile(bound, 95) < values["p95"]


def _rotated(q: np.ndarray, v: tuple[float, float, float]) -> np.ndarray:
    return rot.rotate(q, np.array(v))
