"""The body through time: bones keep their lengths, knees bend forwards, nothing flips, whatever comes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.body.posture import REACH
from foottrack_service.body.skeleton import EYES_ABOVE_NECK, EYES_BEFORE_NECK, Skeleton
from foottrack_service.body.solver import BodySolver, FootPlace
from foottrack_service.config import BodySettings

BODY = Skeleton.of(BodySettings())
UPRIGHT = [0.0, 0.0, 0.0, 1.0]
SOLVERS = ("two-bone", "fabrik")
MS = 1_000_000

small = st.floats(-0.4, 0.4)
angle = st.floats(-math.pi, math.pi)


def pose(yaw, pitch, roll=0.0):
    turn = rot.multiply(rot.from_yaw(yaw), rot.from_axis_angle([1.0, 0.0, 0.0], pitch))
    return rot.multiply(turn, rot.from_axis_angle([0.0, 0.0, 1.0], roll)).tolist()


def place(p, q=(0.0, 0.0, 0.0, 1.0)) -> FootPlace:
    return FootPlace(tuple(p), tuple(q))


def test_lengths_scale_with_the_height_unless_given() -> None:
    small, tall = (Skeleton.of(BodySettings(height=height)) for height in (1.62, 1.90))
    for name in ("thigh", "shank", "torso", "hip_width"):
        assert getattr(tall, name) / getattr(small, name) == pytest.approx(1.90 / 1.62)
    assert Skeleton.of(BodySettings(thigh=0.5)).thigh == 0.5


@pytest.mark.parametrize("solver", SOLVERS)
@settings(max_examples=150, deadline=None)
@given(
    st.tuples(small, st.floats(0.5, 1.9), small),
    st.tuples(angle, st.floats(-1.4, 0.5)),
    st.tuples(small, st.floats(0.0, 0.5), small, angle, st.floats(-1.8, 0.5)),
    st.tuples(small, st.floats(0.0, 0.5), small, angle, st.floats(-1.8, 0.5)),
)
def test_bones_keep_their_lengths_and_knees_bend_forwards(solver, head, looks, left, right) -> None:
    feet = {side: place(foot[:3], pose(foot[3], foot[4])) for side, foot in (("left", left), ("right", right))}
    legs = BodySolver(BODY, solver).solve(0, head, pose(*looks), feet)
    assert math.dist(legs.joints["left"], legs.joints["right"]) == pytest.approx(BODY.hip_width, abs=1e-6)
    forward = rot.rotate(legs.hips_q, [1.0, 0.0, 0.0])
    forward = np.array([forward[2], 0.0, -forward[0]])
    for side, foot in feet.items():
        hip, knee = legs.joints[side], legs.knees[side]
        assert math.dist(hip, knee) == pytest.approx(BODY.thigh, abs=1e-6)
        assert math.dist(knee, foot.p) == pytest.approx(BODY.shank, abs=1e-6)
        assert math.dist(hip, foot.p) <= REACH * (BODY.thigh + BODY.shank) + 1e-9
        if foot.p[1] < hip[1]:
            leg = np.subtract(foot.p, hip) / math.dist(foot.p, hip)
            out = np.subtract(knee, hip) - leg * np.dot(np.subtract(knee, hip), leg)
            assert np.dot(out, forward) > -1e-9


@pytest.mark.parametrize("solver", SOLVERS)
def test_feet_further_apart_than_two_legs_reach_keep_the_thighs_and_the_fused_ankles(solver) -> None:
    feet = {"left": place((-3.0, 0.1, 0.0)), "right": place((3.0, 0.1, 0.0))}
    legs = BodySolver(BODY, solver).solve(0, [0.0, 1.6, 0.0], UPRIGHT, feet)
    for side, foot in feet.items():
        assert math.dist(legs.joints[side], legs.knees[side]) == pytest.approx(BODY.thigh, abs=1e-6)
        across = np.cross(np.subtract(legs.knees[side], legs.joints[side]), np.subtract(foot.p, legs.joints[side]))
        assert np.linalg.norm(across) < 1e-9


@pytest.mark.parametrize("solver", SOLVERS)
@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(-(10**12), 10**12), *[st.floats(-1e3, 1e3)] * 6), min_size=1, max_size=5))
def test_whatever_comes_only_numbers_leave(solver, poses) -> None:
    body = BodySolver(BODY, solver)
    for t, hx, hy, hz, fx, fy, fz in poses:
        for feet in ({}, {"left": place((fx, fy, fz))}, {"left": place((fx, fy, fz)), "right": place((hx, hy, hz))}):
            legs = body.solve(t, [hx, hy, hz], UPRIGHT, feet)
            for p in (legs.hips, legs.hips_q, *legs.joints.values(), *legs.knees.values()):
                assert np.isfinite(p).all()
            assert math.hypot(*legs.hips_q) == pytest.approx(1.0)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_push_off_until_the_foot_points_down_moves_the_knee_smoothly(solver) -> None:
    """Heel up to 110 deg over 0.3 s at 200 Hz while the ankle rises: the knee moves as far as the ankle, not more."""
    body = BodySolver(BODY, solver)
    knees, ankles = [], []
    for step in range(60):
        share = step / 59
        ankle = (0.09, 0.09 + 0.15 * share, 0.2 - 0.1 * share)
        feet = {"left": place((-0.09, 0.09, -0.2)), "right": place(ankle, pose(0.05, -1.92 * share))}
        knees.append(body.solve(step * 5 * MS, [0.0, 1.60, 0.0], UPRIGHT, feet).knees["right"])
        ankles.append(ankle)
    most = np.linalg.norm(np.diff(knees, axis=0), axis=1).max()
    assert most < 4.0 * np.linalg.norm(np.diff(ankles, axis=0), axis=1).max()


def test_fabrik_keeps_the_spine_where_two_bones_would_stretch_it() -> None:
    """Leaning far to the side on stretched legs: the trunk can tilt, and its length is its own."""
    head = [0.5, 1.50, -0.02]
    feet = {"left": place((-0.1, 0.09, 0.0)), "right": place((0.1, 0.09, 0.0))}
    spine = math.hypot(BODY.torso - EYES_ABOVE_NECK, BODY.hip_back - EYES_BEFORE_NECK)
    neck = (head[0], head[1] - EYES_ABOVE_NECK, head[2] + EYES_BEFORE_NECK)
    stretch = {
        solver: math.dist(BodySolver(BODY, solver).solve(0, head, UPRIGHT, feet).hips, neck) / spine - 1.0
        for solver in SOLVERS
    }
    assert stretch["two-bone"] > 0.02
    assert abs(stretch["fabrik"]) < 0.005


def test_both_solvers_agree_where_trunk_and_legs_fit() -> None:
    feet = {"left": place((-0.1, 0.09, 0.0)), "right": place((0.1, 0.09, -0.1))}
    found = [BodySolver(BODY, solver).solve(0, [0.0, 1.50, -0.05], UPRIGHT, feet) for solver in SOLVERS]
    assert np.allclose(found[0].hips, found[1].hips, atol=2e-3)
    for side in feet:
        assert np.allclose(found[0].knees[side], found[1].knees[side], atol=5e-3)


def test_a_new_skeleton_counts_from_the_next_pose() -> None:
    body = BodySolver(BODY, "fabrik")
    feet = {"left": place((-0.1, 0.09, 0.0))}
    body.solve(0, [0.0, 1.5, 0.0], UPRIGHT, feet)
    body.skeleton = Skeleton(1.9, 0.5, 0.4, 0.7, 0.2, 0.1)
    legs = body.solve(5 * MS, [0.0, 1.5, 0.0], UPRIGHT, feet)
    assert math.dist(legs.joints["left"], legs.knees["left"]) == pytest.approx(0.5, abs=1e-6)
