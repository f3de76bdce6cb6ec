"""The neck's place from a nod: found where it shows, left alone where it does not, and never made worse."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from calibration_people import LOOKING_AHEAD, standing, watch

from foottrack_service import rotations as rot
from foottrack_service.body.skeleton import EYES_ABOVE_NECK, EYES_BEFORE_NECK, Skeleton
from foottrack_service.body.solver import BodySolver, FootPlace
from foottrack_service.calibration.body import BodyFlow
from foottrack_service.calibration.nod import neck_of
from foottrack_service.config import Settings
from foottrack_service.simulation import noise
from foottrack_service.simulation.scenario import simulate
from foottrack_service.simulation.tasks import TASKS

SETTINGS = Settings()
HZ = 90.0
T = np.arange(0.0, 3.0, 1.0 / HZ)


def nodding(down, back, most=55.0, turn=0.0, way=0.0, sway=0.0, seed=0):
    """Places and turns of a head that looks ``most`` deg down and up about a neck that goes ``way`` m and sways."""
    pitch = -math.radians(most) * np.sin(np.pi * T / T[-1]) ** 2
    q = rot.multiply(rot.from_yaw(0.3 + math.radians(turn) * T / T[-1]), rot.from_axis_angle([1.0, 0.0, 0.0], pitch))
    neck = np.outer(T / T[-1], [0.0, 0.0, -way]) + noise.wander(np.random.default_rng(seed), len(T), HZ, 0.4, sway)
    return neck + [0.5, 1.5, 0.2] + rot.rotate(q, [0.0, down, -back]), q


@pytest.mark.parametrize("down", [0.07, 0.10, 0.13])
@pytest.mark.parametrize("back", [0.06, 0.085, 0.11])
def test_the_pivot_of_a_body_that_stands_still(down, back):
    found = neck_of(T, *nodding(down, back))
    assert found == pytest.approx((down, back), abs=0.003)


@pytest.mark.parametrize("most", [30.0, 55.0])
def test_a_body_that_sways_does_not_make_it_worse(most):
    random, better = np.random.default_rng(7), []
    for seed in range(60):
        down, back = random.normal([0.10, 0.085], 0.02).clip([0.06, 0.045], [0.14, 0.125])
        found = neck_of(T, *nodding(down, back, most, sway=0.005, seed=seed))
        usual = math.hypot(down - EYES_ABOVE_NECK, back - EYES_BEFORE_NECK)
        error = usual if found is None else math.hypot(found.down - down, found.back - back)
        better.append(usual - error)
    assert min(better) > -0.015
    assert np.mean(better) > (0.004 if most < 50.0 else 0.01)


@pytest.mark.parametrize(
    "head",
    [
        nodding(0.10, 0.085, most=20.0),
        nodding(0.10, 0.085, turn=60.0),
        nodding(0.10, 0.085, way=0.3),
        nodding(0.25, 0.085),
        nodding(0.10, 0.20),
    ],
    ids=["hardly nods", "turns", "walks", "bows", "bends over"],
)
def test_what_is_no_nod_says_nothing(head):
    assert neck_of(T, *head) is None
    assert neck_of(T[:5], head[0][:5], head[1][:5]) is None


@cache
def calibrated(seed):
    messages = simulate("calibration", seed, settings=SETTINGS, seconds=30.0, depth=False, camera=False).messages()
    flow = BodyFlow(SETTINGS)
    told = watch(flow, messages)
    assert "Now look down at your feet, and up again." in told
    return flow.found.values


def hips_error(body, task):
    """Mean over 12 s, m."""
    truth, solver = TASKS[task].truth(12.0, SETTINGS, "mild", np.random.default_rng(7)), BodySolver(body)
    t = np.arange(0.0, 12.0, 1.0 / 30.0)
    (heads, turns), hips = truth.head.pose(t), truth.hips.pose(t)[0]
    feet = {side: track.pose(t) for side, track in truth.feet.items()}
    found = [
        solver.solve(
            round(t[k] * 1e9),
            heads[k].tolist(),
            turns[k].tolist(),
            {side: FootPlace(tuple(p[k].tolist()), tuple(q[k].tolist())) for side, (p, q) in feet.items()},
        ).hips
        for k in range(len(t))
    ]
    return float(np.linalg.norm(np.array(found) - hips, axis=1).mean())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_hips_of_who_was_calibrated_are_nearer_by_half(seed):
    values = calibrated(seed)
    assert (values.neck_down, values.neck_back) == pytest.approx((0.12, 0.09), abs=0.008)
    learned = Skeleton.calibrated(values)
    usual = Skeleton.calibrated(values.model_copy(update={"neck_down": None, "neck_back": None}))
    assert usual.neck_down == EYES_ABOVE_NECK
    for task in ("walk", "walk-in-place"):
        assert hips_error(learned, task) < 0.022
        assert hips_error(learned, task) < 0.65 * hips_error(usual, task)
        assert hips_error(learned, task) < 0.5 * hips_error(Skeleton.of(SETTINGS.body), task)


def test_who_does_not_nod_gets_measures_all_the_same():
    run = simulate("standing", 3, settings=SETTINGS, seconds=12.0, motion=standing(LOOKING_AHEAD), camera=False)
    flow = BodyFlow(SETTINGS)
    watch(flow, run.messages())
    assert flow.found.values.height == pytest.approx(1.75, abs=0.015)
    assert (flow.found.values.neck_down, flow.found.values.neck_back) == (None, None)
