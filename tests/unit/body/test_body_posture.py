"""Hips between head and feet: looks, leans, crouches, and feet that are far apart."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.body.posture import HIPS_BEFORE_ANKLES, REACH, Facing, hips_below, neck, place
from foottrack_service.body.skeleton import EYES_ABOVE_NECK, EYES_BEFORE_NECK, Skeleton

BODY = Skeleton(1.75, 0.43, 0.43, 0.70, 0.18, 0.09)
LEG = REACH * (BODY.thigh + BODY.shank)
AHEAD = Facing.of(0.0)
FEET = {"left": (-0.1, 0.09, 0.0), "right": (0.1, 0.09, 0.0)}
RISE = BODY.torso - EYES_ABOVE_NECK
UPRIGHT = (0.0, 0.09 + LEG + RISE, -HIPS_BEFORE_ANKLES - (BODY.hip_back - EYES_BEFORE_NECK))

coordinate = st.floats(-1.5, 1.5)


def test_who_stands_upright_has_the_hips_a_leg_above_the_ankles() -> None:
    hips, pitch = hips_below(UPRIGHT, AHEAD, FEET, BODY)
    assert hips == pytest.approx((0.0, 0.09 + LEG, -HIPS_BEFORE_ANKLES))
    assert pitch == pytest.approx(0.0)


def test_a_look_down_does_not_move_the_hips() -> None:
    pivot = np.array([0.0, 1.5, 0.0])
    for pitch in np.radians([-70.0, -30.0, 0.0, 20.0]):
        q = rot.from_axis_angle([1.0, 0.0, 0.0], pitch)
        eyes = pivot + rot.rotate(q, [0.0, EYES_ABOVE_NECK, -EYES_BEFORE_NECK])
        assert np.allclose(neck(eyes, q.tolist(), BODY), pivot)


def test_a_bow_sends_the_hips_back_and_keeps_the_trunk_s_length() -> None:
    """Balance puts the hips 0.4 m behind the feet per metre that the neck is ahead of the hips."""
    over = 0.45
    bowed = (0.0, 0.09 + LEG + math.sqrt(RISE**2 - over**2), UPRIGHT[2] - over + 0.4 * over)
    hips, pitch = hips_below(bowed, AHEAD, FEET, BODY)
    assert math.dist(hips, bowed) == pytest.approx(math.hypot(RISE, BODY.hip_back - EYES_BEFORE_NECK), abs=1e-9)
    assert hips[2] == pytest.approx(UPRIGHT[2] + 0.4 * over, abs=0.04)
    assert hips[1] == pytest.approx(0.09 + LEG, abs=0.04)
    assert math.degrees(pitch) == pytest.approx(math.degrees(math.asin(over / RISE)), abs=6.0)


def test_a_crouch_with_an_upright_trunk_lowers_the_hips_as_much_as_the_head() -> None:
    low = (0.0, UPRIGHT[1] - 0.02, UPRIGHT[2])
    hips, pitch = hips_below(low, AHEAD, FEET, BODY)
    assert hips == pytest.approx((0.0, 0.09 + LEG - 0.02, -HIPS_BEFORE_ANKLES))
    assert pitch == pytest.approx(0.0)


def test_with_one_foot_nothing_tells_a_lean() -> None:
    _, pitch = hips_below((0.0, 1.1, -0.5), AHEAD, {"left": FEET["left"]}, BODY)
    assert pitch == pytest.approx(0.0)


def test_hips_pitch_forwards_with_the_trunk_and_keep_their_joints_level() -> None:
    hips = place((0.0, 0.9, 0.0), 0.4, Facing.of(0.7), FEET, BODY)
    up = rot.rotate(hips.q, [0.0, 1.0, 0.0])
    assert np.dot(up, Facing.of(0.7).forward) == pytest.approx(math.sin(0.4))
    assert np.allclose(rot.rotate(hips.q, [1.0, 0.0, 0.0]), Facing.of(0.7).right)
    across = np.subtract(hips.joints["right"], hips.joints["left"])
    assert np.allclose(across, BODY.hip_width * np.array(Facing.of(0.7).right))


# Within one leg's reach and beyond the other's.
@example((0.5, 0.0, 0.0), (-0.09, 0.0, 0.0), (1.5 + 0.09, 0.0, 0.0))
@given(st.tuples(coordinate, coordinate, coordinate), *[st.tuples(coordinate, coordinate, coordinate)] * 2)
def test_reach_never_exceeds_the_legs_and_the_hips_move_no_further_than_needed(hips, left, right) -> None:
    ankles = {"left": left, "right": right}
    half = np.array([0.5 * BODY.hip_width, 0.0, 0.0])
    centres = [np.add(left, half), np.subtract(right, half)]
    assume(math.dist(*centres) < 1.98 * LEG)
    assume(min(math.dist(hips, centre) for centre in centres) > 0.3)
    found = np.array(place(hips, 0.0, AHEAD, ankles, BODY).p)
    for centre in centres:
        assert math.dist(found, centre) <= LEG + 1e-9
    # A projection onto a convex set: everything allowed lies beyond the plane across the move.
    random = np.random.default_rng(0)
    for allowed in found + random.normal(0.0, 0.2, (50, 3)):
        if all(math.dist(allowed, centre) <= LEG for centre in centres):
            assert np.dot(np.subtract(hips, found), allowed - found) <= 1e-9


def test_feet_too_far_apart_get_hips_in_the_middle() -> None:
    far = {"left": (-2.0, 0.1, 0.0), "right": (2.0, 0.1, 0.4)}
    assert place((0.0, 0.9, 0.0), 0.0, AHEAD, far, BODY).p == pytest.approx((0.0, 0.1, 0.2))
