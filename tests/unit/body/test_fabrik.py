"""FABRIK against what its authors say of it (Aristidou and Lasenby 2011), and against the analytic leg."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from foottrack_service.body.fabrik import Fabrik, Joint
from foottrack_service.body.legs import bend_direction, knee
from foottrack_service.body.limits import Cone, Hinge, Rigid
from foottrack_service.body.skeleton import Skeleton

UP, RIGHT, FORWARD, DOWN = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, -1.0, 0.0)
coordinate = st.floats(-1.0, 1.0)
point = st.tuples(coordinate, coordinate, coordinate)


def chain(*lengths: float) -> Fabrik:
    return Fabrik([Joint(None), *(Joint(index, length) for index, length in enumerate(lengths))])


def lengths_of(points, parents):
    return [math.dist(points[index], points[parent]) for index, parent in enumerate(parents, start=1)]


def random_chain(count: int, seed: int):
    steps = np.random.default_rng(seed).normal(size=(count, 3))
    steps *= 0.1 / np.linalg.norm(steps, axis=1, keepdims=True)
    return [(0.0, 0.0, 0.0), *map(tuple, np.cumsum(steps, axis=0).tolist())]


def test_one_iteration_by_hand() -> None:
    """Two bones of 1 along x, target (1, 1, 0). Backward: the end on the target, the elbow at distance 1 from it
    towards (1, 0, 0), which is (1, 0, 0) itself; forward: nothing left to do."""
    found = chain(1.0, 1.0).solve([(0, 0, 0), (1, 0, 0), (2, 0, 0)], {2: (1.0, 1.0, 0.0)})
    assert found.iterations == 1
    assert np.allclose(found.points, [(0, 0, 0), (1, 0, 0), (1, 1, 0)])


def test_a_second_one_by_hand() -> None:
    """Target (0, 1, 0): backward, the elbow goes to (0, 1, 0) + (1, -1, 0)/sqrt 2; forward, back to distance 1."""
    found = chain(1.0, 1.0).solve([(0, 0, 0), (1, 0, 0), (2, 0, 0)], {2: (0.0, 1.0, 0.0)}, most_iterations=1)
    r = math.sqrt(0.5)
    elbow = np.array([r, 1.0 - r, 0.0]) / math.hypot(r, 1.0 - r)
    end = elbow + (np.array([0.0, 1.0, 0.0]) - elbow) / np.linalg.norm(np.array([0.0, 1.0, 0.0]) - elbow)
    assert np.allclose(found.points[1], elbow)
    assert np.allclose(found.points[2], end)


def test_targets_within_reach_are_met_in_about_the_published_number_of_iterations() -> None:
    """The paper: 10 joints, targets within reach, 15.5 iterations in the mean."""
    iterations = []
    for seed in range(50):
        direction = np.random.default_rng(seed + 100).normal(size=3)
        target = tuple((0.7 * direction / np.linalg.norm(direction)).tolist())
        found = chain(*[0.1] * 10).solve(random_chain(10, seed), {10: target}, tolerance=1e-3, most_iterations=200)
        assert found.error <= 1e-3
        assert lengths_of(found.points, range(10)) == pytest.approx([0.1] * 10, abs=1e-12)
        assert found.points[0] == (0.0, 0.0, 0.0)
        iterations.append(found.iterations)
    assert np.mean(iterations) < 15.5


@given(st.integers(0, 1000), point)
def test_a_target_out_of_reach_is_pointed_at_with_a_straight_chain(seed, direction) -> None:
    assume(math.hypot(*direction) > 0.1)
    target = tuple(2.0 * c / math.hypot(*direction) for c in direction)
    found = chain(*[0.1] * 5).solve(random_chain(5, seed), {5: target})
    for index, place in enumerate(found.points):
        assert np.allclose(place, [0.05 * index * c for c in target])
    assert found.error == pytest.approx(1.5)


@settings(deadline=None)
@given(st.integers(0, 1000), point)
def test_every_iteration_of_a_chain_comes_nearer(seed, target) -> None:
    points = random_chain(6, seed)
    tree = chain(*[0.1] * 6)
    errors = [math.dist(points[6], target)]
    for iterations in range(1, 6):
        errors.append(tree.solve(points, {6: target}, most_iterations=iterations, tolerance=0.0).error)
    assert all(later <= earlier + 1e-12 for earlier, later in itertools.pairwise(errors[1:]))


TREE = [Joint(None), Joint(0, 0.3), Joint(1, 0.3), Joint(2, 0.2), Joint(3, 0.2), Joint(2, 0.2), Joint(5, 0.2)]
"""A trunk of two bones that forks into two arms of two."""
PARENTS = [0, 1, 2, 3, 2, 5]
BENT = [(0, 0, 0), (0.05, 0.3, 0), (0, 0.6, 0), (0.15, 0.7, 0), (0.3, 0.6, 0), (-0.15, 0.7, 0), (-0.3, 0.6, 0)]


def test_two_end_effectors_that_can_both_be_met_are_met() -> None:
    # What another pose of the same tree has can be met.
    bent = [
        (0, 0, 0),
        (0.1, 0.25, 0.1),
        (0.1, 0.5, 0.2),
        (0.3, 0.5, 0.3),
        (0.4, 0.4, 0.2),
        (0, 0.6, 0.1),
        (-0.1, 0.5, 0),
    ]
    pose = Fabrik(TREE).solve(bent, {4: (0.0, 0.0, 0.0)}, most_iterations=0).points
    found = Fabrik(TREE).solve(BENT, {4: pose[4], 6: pose[6]}, tolerance=1e-4, most_iterations=200)
    assert found.error <= 1e-4
    assert lengths_of(found.points, PARENTS) == pytest.approx([j.length for j in TREE[1:]], abs=1e-12)


def test_two_end_effectors_that_pull_apart_share_the_loss() -> None:
    """Mirror images: what the fork gives to one it takes from the other, so it stays in the middle."""
    found = Fabrik(TREE).solve(BENT, {4: (2.0, 0.6, 0.0), 6: (-2.0, 0.6, 0.0)}, most_iterations=50)
    left, right = found.points[6], found.points[4]
    assert left[0] == pytest.approx(-right[0], abs=0.02)
    assert right[0] > 0.35
    assert lengths_of(found.points, PARENTS) == pytest.approx([j.length for j in TREE[1:]], abs=1e-12)


def test_a_branch_without_an_end_effector_keeps_its_shape_and_comes_along() -> None:
    found = Fabrik(TREE).solve(BENT, {4: (0.35, 0.65, 0.05)})
    assert found.error <= 1e-4
    assert lengths_of(found.points, PARENTS) == pytest.approx([j.length for j in TREE[1:]], abs=1e-12)


@pytest.mark.parametrize("joints", [[], [Joint(0, 1.0)], [Joint(None), Joint(1, 1.0)], [Joint(None), Joint(0, 0.0)]])
def test_what_is_no_tree_is_refused(joints) -> None:
    with pytest.raises(ValueError):
        Fabrik(joints)


LEG = Skeleton(1.75, 0.45, 0.38, 0.7, 0.2, 0.09)


@settings(max_examples=200)
@given(st.floats(0.35, 0.81), st.floats(-1.0, 1.0), st.floats(-0.6, 0.6), st.floats(-0.5, 0.5))
def test_a_hinged_leg_bends_as_the_analytic_one(length, swing, aside, start) -> None:
    """Within the hinge's plane there is one solution, whatever the beginning."""
    down = np.array([math.sin(aside), -math.cos(aside) * math.cos(swing), -math.cos(aside) * math.sin(swing)])
    hip, ankle = (0.1, 0.9, 0.0), tuple((np.array([0.1, 0.9, 0.0]) + length * down).tolist())
    expected = knee(hip, ankle, RIGHT, FORWARD, LEG)
    normal = tuple(np.cross(down, bend_direction(tuple(down.tolist()), RIGHT, FORWARD)).tolist())
    begin = (expected[0] + 0.1 * start, expected[1] - 0.1 * start, expected[2] + 0.1 * start)
    found = chain(LEG.thigh, LEG.shank).solve(
        [hip, begin, ankle], {2: ankle}, {2: Hinge(normal, 2.7)}, tolerance=1e-7, most_iterations=2000
    )
    assert found.error < 1e-6
    assert math.dist(found.points[1], expected) < 1e-4


def angle(a, b) -> float:
    return math.degrees(math.acos(max(-1.0, min(1.0, float(np.dot(a, b))))))


@given(point)
def test_a_cone_keeps_its_ellipse(direction) -> None:
    assume(math.hypot(*direction) > 0.1)
    bone = tuple((np.array(direction) / math.hypot(*direction)).tolist())
    cone = Cone(FORWARD, RIGHT, tuple(np.radians([120.0, 30.0, 50.0, 20.0])), DOWN)
    found = cone(DOWN, bone)
    assert math.hypot(*found) == pytest.approx(1.0)
    assert np.allclose(cone(DOWN, found), found, atol=1e-9)
    assert angle(DOWN, found) <= 120.0 + 1e-6


@pytest.mark.parametrize(
    ("towards", "most"), [(FORWARD, 120.0), ((0.0, 0.0, 1.0), 30.0), (RIGHT, 50.0), ((-1.0, 0.0, 0.0), 20.0)]
)
def test_a_cone_s_four_sides(towards, most) -> None:
    cone = Cone(FORWARD, RIGHT, tuple(np.radians([120.0, 30.0, 50.0, 20.0])), DOWN)
    for degrees in (0.5 * most, most - 1.0, most + 1.0, 170.0):
        turn = math.radians(degrees)
        bone = tuple((math.cos(turn) * np.array(DOWN) + math.sin(turn) * np.array(towards)).tolist())
        found = cone(DOWN, bone)
        assert angle(DOWN, found) == pytest.approx(min(degrees, most), abs=1e-6)
        assert np.dot(found, towards) > 0.0


@given(point, point)
def test_a_knee_s_hinge_bends_backwards_only_and_in_its_plane(thigh, shank) -> None:
    assume(math.hypot(*thigh) > 0.1 and math.hypot(*shank) > 0.1 and math.hypot(thigh[1], thigh[2]) > 0.05)
    thigh, shank = (tuple((np.array(v) / math.hypot(*v)).tolist()) for v in (thigh, shank))
    found = Hinge(RIGHT, math.radians(150.0))(thigh, shank)
    assert math.hypot(*found) == pytest.approx(1.0)
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    straight = np.array([0.0, thigh[1], thigh[2]]) / math.hypot(thigh[1], thigh[2])
    assert np.dot(np.cross(straight, found), RIGHT) <= 1e-9
    assert angle(straight, found) <= 150.0 + 1e-6


def test_a_rigid_bone_has_one_direction_in_the_tree() -> None:
    found = chain(0.2, 0.5).solve([(0, 0, 0), (0.2, 0, 0), (0.2, -0.5, 0)], {2: (0.4, -0.4, 0.0)}, {1: Rigid(RIGHT)})
    assert found.points[1] == pytest.approx((0.2, 0.0, 0.0))
