"""Toe-off of the simulated person's own feet, without any sensor: what the detector itself errs by."""

import numpy as np
import pytest
from walkers import SHOE

from foottrack_service.config import Settings
from foottrack_service.evaluation.gait_metrics import match
from foottrack_service.gait.foot_phases import FootPhases
from foottrack_service.gait.samples import FootSample
from foottrack_service.simulation.marching import marching

SECONDS = 15.0


def errors(cadence, peak):
    """Found minus true, s, of every toe-off of both feet."""
    truth = marching(cadence, peak)(SECONDS, Settings(), "mild", np.random.default_rng(5))
    t = np.arange(0.0, SECONDS, 0.005)
    found = []
    for track in truth.feet.values():
        p, q = track.pose(t)
        v = track.velocity(t)
        heel, toe = track.contact(t)
        phases, at = FootPhases(SHOE), []
        for k, stamp in enumerate(t):
            foot = FootSample(tuple(p[k]), tuple(q[k]), tuple(v[k]), bool(heel[k] or toe[k]))
            phases.update(round(stamp * 1e9), foot)
            at += [when * 1e-9 for when, name in phases.events if name == "toe_off"]
        grid = np.arange(0.0, SECONDS - 0.5, 0.001)
        down = np.logical_or(*track.contact(grid))
        matched = match(grid[1:][~down[1:] & down[:-1]], np.array(at))
        assert (matched.found, matched.extra) == (matched.true, 0)
        found.append(matched.errors)
    return np.concatenate(found)


@pytest.mark.parametrize("peak", [0.05, 0.1, 0.2, 0.35])
@pytest.mark.parametrize("cadence", [0.8, 1.6, 2.5])
def test_a_foot_that_rolls_over_its_toes_has_not_left_the_floor(cadence, peak):
    """Taken for a straight line, the sole from ball to tip seems to rise by 5 mm while it rolls."""
    found = errors(cadence, peak)
    assert np.std(found) < 0.0015
    assert abs(np.mean(found)) < 0.01


def test_a_sole_without_toe_spring_stands_on_its_tip():
    flat = FootPhases(SHOE._replace(toe_below=SHOE.ankle_height))
    q = (-np.sin(0.1), 0.0, 0.0, np.cos(0.1))
    tip = SHOE.ankle_height * np.cos(0.2) + SHOE.toe_ahead * np.sin(0.2)
    level = FootSample((0.0, SHOE.ankle_height, 0.0), (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), True)
    flat.update(0, level)
    flat.update(5_000_000, level)
    rolled = FootSample((0.0, tip, 0.0), q, (0.0, (tip - SHOE.ankle_height) / 0.0025, 0.0), False)
    flat.update(10_000_000, rolled)
    assert flat.lift == pytest.approx(0.0, abs=1e-9)
