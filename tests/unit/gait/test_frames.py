"""Frames of uneven length, as two IMUs of 100 Hz make them; and landings that are measured below the floor."""

import numpy as np
import pytest
from walkers import ANKLE, WEARER, marching

from foottrack_service.evaluation.gait_metrics import jumps_m, skates_m
from foottrack_service.gait.gait import Gait
from foottrack_service.gait.settings import GaitSettings


def walked(cadence, peak, sink=0.0, seed=3):
    """Stamps (n,) s, speeds (n,) m/s, and per side targets' z, y above standing (n, 2) m and contact (n,)."""
    gait, random = Gait(WEARER, GaitSettings()), np.random.default_rng(seed)
    left, right = marching(cadence, peak, 6.0)
    t = np.cumsum(random.uniform(0.002, 0.014, 1000))
    rows = []
    for now in t:
        feet = [_sunk(foot.sample(now), sink) for foot in (left, right)]
        ik = gait.update(round(now * 1e9), *feet, None, 0.0).ik
        rows.append([ik.speed] + [x for foot in (ik.left, ik.right) for x in (-foot.p[2], foot.p[1] - ANKLE)])
    rows = np.array(rows)
    down = [np.array([foot.sample(now).contact for now in t]) for foot in (left, right)]
    return t, rows[:, 0], {"left": (rows[:, 1:3], down[0]), "right": (rows[:, 3:5], down[1])}


def _sunk(foot, sink):
    """What a clipped impact leaves: falling feet are thought to fall further."""
    return foot if foot.v[1] >= 0.0 else foot._replace(v=(foot.v[0], foot.v[1] * (1.0 + sink), foot.v[2]))


@pytest.mark.parametrize("peak", [0.05, 0.1, 0.2, 0.35])
@pytest.mark.parametrize("cadence", [1.6, 2.0, 2.5])
def test_how_long_a_frame_is_does_not_show(cadence, peak):
    t, speed, feet = walked(cadence, peak)
    assert np.max(speed) > 0.5
    for target, down in feet.values():
        assert np.max(jumps_m(t, target)) < 0.0007
        assert max(skates_m(t, target[:, 0], target[:, 1], speed, down)) < 0.003


@pytest.mark.parametrize("pause", [1.9, 2.0, 2.1, 2.2, 2.3, 2.4])
def test_a_step_amid_the_legs_return_under_the_hips_does_not_drop_them(pause):
    left, right = marching(2.0, 0.2, 4.0)
    again = max(left.begins[-1], right.begins[-1]) + left.swing + pause
    for foot in (left, right):
        foot.begins.append(again)
        foot.peaks.append(0.2)
        foot.turns.append(0.0)
        again += 0.5
    gait, t = Gait(WEARER, GaitSettings()), np.arange(0.0, again, 0.005)
    y = []
    for now in t:
        ik = gait.update(round(now * 1e9), left.sample(now), right.sample(now), None, 0.0).ik
        y.append([ik.left.p[1], ik.right.p[1]])
    assert np.max(jumps_m(t, np.array(y))) < 0.0007


@pytest.mark.parametrize("sink", [0.05, 0.1])
def test_a_foot_that_is_measured_below_the_floor_brakes_before_it(sink):
    t, _, feet = walked(2.5, 0.35, sink)
    for target, _ in feet.values():
        assert np.min(target[:, 1]) >= 0.0
        assert np.max(jumps_m(t, target[:, 1:])) < 0.0005
        pace = np.diff(target[:, 1]) / np.diff(t)
        assert np.max(np.diff(pace) / (0.5 * (t[2:] - t[:-2]))) < 130.0
