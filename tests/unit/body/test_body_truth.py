"""Knees and hips against the simulated person's, and what each source of the knee's direction is worth.

The simulation has no knees of its own: they are those of two bones of the person's lengths between the true hip joint
and ankle, about an axis half the pelvis's, half the foot's.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from foottrack_service import rotations as rot
from foottrack_service.body import legs
from foottrack_service.body.facing import PelvisFacing, foot_yaw, head_yaw
from foottrack_service.body.posture import Facing
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.body.solver import BodySolver, FootPlace
from foottrack_service.config import Settings
from foottrack_service.simulation.anatomy import knees, person
from foottrack_service.simulation.tasks import TASKS

SETTINGS = Settings()
PERSON = person(SETTINGS.body, SETTINGS.feet.left.ankle_height)
BODY = Skeleton(1.75, PERSON.thigh, PERSON.shank, 0.936 * 1.75 - PERSON.hip_height, PERSON.hip_spacing, hip_back=0.09)
HZ = 60


class Run(NamedTuple):
    t: np.ndarray
    head: tuple[np.ndarray, np.ndarray]
    hips: np.ndarray
    feet: dict
    joints: dict
    knees: dict


@cache
def run(task: str, seconds: float = 20.0) -> Run:
    truth = TASKS[task].truth(seconds, SETTINGS, "mild", np.random.default_rng(7))
    t = np.arange(0.0, seconds, 1.0 / HZ)
    hips, facing = truth.hips.pose(t)
    right = rot.rotate(facing, [1.0, 0.0, 0.0])
    feet, joints, found = {}, {}, {}
    for side, sign in (("left", -0.5), ("right", 0.5)):
        p, q = feet[side] = truth.feet[side].pose(t)
        lateral = rot.rotate(q, [1.0, 0.0, 0.0]) * [1.0, 0.0, 1.0]
        axis = right + lateral
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        joints[side] = hips + sign * PERSON.hip_spacing * right
        found[side] = knees(joints[side], p, np.cross([0.0, 1.0, 0.0], axis), PERSON)
    return Run(t, truth.head.pose(t), hips, feet, joints, found)


def solved(task: str, solver: str):
    """Errors of hips and knees, m."""
    truth, body = run(task), BodySolver(BODY, solver)
    hips, bent = [], []
    for index, t in enumerate(truth.t):
        feet = {
            side: FootPlace(tuple(p[index].tolist()), tuple(q[index].tolist())) for side, (p, q) in truth.feet.items()
        }
        found = body.solve(int(t * 1e9), truth.head[0][index].tolist(), truth.head[1][index].tolist(), feet)
        hips.append(math.dist(found.hips, truth.hips[index]))
        bent += [math.dist(found.knees[side], truth.knees[side][index]) for side in feet]
    return np.array(hips), np.array(bent)


@pytest.mark.parametrize("solver", ["two-bone", "fabrik"])
@pytest.mark.parametrize(
    ("task", "hips_mm", "knee_mm"),
    [("walk", 30, 45), ("walk-in-place", 25, 45), ("circle", 36, 45), ("knee-bends", 60, 65), ("head-moving", 25, 50)],
)
def test_hips_and_knees_of_a_person_whose_head_and_feet_are_known(task, hips_mm, knee_mm, solver) -> None:
    """20 mm of the hips' error is where the neck is, which the simulated person has elsewhere than we assume; in a walk
    the trunk leans and turns against the pelvis on top."""
    hips, bent = solved(task, solver)
    assert 1000.0 * hips.mean() < hips_mm
    assert 1000.0 * bent.mean() < knee_mm


def by_pole(task: str) -> dict[str, float]:
    """Mean error of the knee between the true hip joint and ankle, m, by where its direction comes from."""
    truth, facing = run(task), PelvisFacing()
    errors: dict[str, list[float]] = {}
    for index, t in enumerate(truth.t):
        head = head_yaw(truth.head[1][index].tolist())
        turns = {side: q[index].tolist() for side, (_, q) in truth.feet.items()}
        pelvis = Facing.of(facing.update(int(t * 1e9), head, [foot_yaw(q) for q in turns.values()]))
        looks = Facing.of(head)
        for side, q in turns.items():
            lateral = Facing.of(foot_yaw(q))
            axes = {
                "lateral": lateral.right,
                "head": looks.right,
                "ours": legs.knee_axis(pelvis.right, pelvis.forward, tuple(q)),
            }
            hip, ankle = tuple(truth.joints[side][index]), tuple(truth.feet[side][0][index])
            for name, axis in axes.items():
                found = legs.knee(hip, ankle, axis, pelvis.forward, BODY)
                errors.setdefault(name, []).append(math.dist(found, truth.knees[side][index]))
    return {name: float(np.mean(values)) for name, values in errors.items()}


@pytest.mark.parametrize("task", ["walk", "circle", "line", "knee-bends"])
def test_pelvis_and_foot_together_are_the_best_source_of_a_knee_s_direction(task) -> None:
    error = by_pole(task)
    assert error["ours"] < min(error["lateral"], error["head"])


def test_the_pelvis_does_not_follow_a_head_that_turns_over_standing_feet() -> None:
    error = by_pole("upper-body")
    assert error["ours"] < 0.6 * error["head"]
