"""What a source says becomes `head/pose`: loss, glitches, jumps, recentring."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_service import rotations
from foottrack_service.headset.rigid import NOWHERE, Rigid, mirrored, rigid
from foottrack_service.headset.stream import HeadStream

MS = 1_000_000
UP = rotations.IDENTITY
coordinates = st.floats(-3.0, 3.0)


def at(x: float, yaw: float = 0.0) -> Rigid:
    return rigid((x, 1.6, 0.0), rotations.from_yaw(yaw))


def test_a_moving_head_keeps_its_origin() -> None:
    stream = HeadStream()
    for k in range(200):
        message = stream.pose(k * 11 * MS, at(0.02 * k, 0.1 * k))
        assert message is not None
        assert message.body.tracked and message.body.origin == 0 and message.body.moved is None
    assert stream.taken == {"poses": 200}
    assert not stream.drops


def test_one_glitch_is_not_tracked_and_forgotten() -> None:
    stream = HeadStream()
    bodies = []
    for k in range(10):
        message = stream.pose(k * 11 * MS, at(5.0 if k == 5 else 0.0))
        assert message is not None
        bodies.append(message.body)
    assert [body.tracked for body in bodies] == [k != 5 for k in range(10)]
    assert {body.origin for body in bodies} == {0}
    assert stream.drops == {"glitch": 1}


@pytest.mark.parametrize("there", [at(0.5), at(0.0, yaw=0.6)])
def test_a_jump_that_stays_is_another_stage_and_nobody_says_how_far(there: Rigid) -> None:
    stream = HeadStream()
    stream.pose(0, at(0.0))
    first, second, third = (stream.pose(k * 11 * MS, there) for k in (1, 2, 3))
    assert first is not None and second is not None and third is not None
    assert not first.body.tracked
    assert (second.body.tracked, second.body.origin, second.body.moved) == (True, 1, None)
    assert third.body.origin == 1


def test_after_a_long_hole_a_head_may_be_anywhere() -> None:
    stream = HeadStream()
    stream.pose(0, at(0.0))
    assert stream.lost(20 * MS).body.tracked is False
    message = stream.pose(2_000 * MS, at(1.5, yaw=3.0))
    assert message is not None and message.body.tracked and message.body.origin == 0


def test_a_known_recentring_is_told_once_with_the_first_message() -> None:
    stream = HeadStream()
    stream.pose(0, at(0.0))
    moved = rigid((1.0, 0.0, 2.0), rotations.from_yaw(0.5))
    stream.recentred(moved)
    first = stream.pose(11 * MS, moved.then(at(0.0)))
    second = stream.pose(22 * MS, moved.then(at(0.0)))
    assert first is not None and second is not None
    assert first.body.tracked and first.body.origin == second.body.origin == 1
    assert first.body.moved is not None and second.body.moved is None
    np.testing.assert_allclose(first.body.moved.p, (1.0, 0.0, 2.0))
    np.testing.assert_allclose(first.body.moved.q, rotations.from_yaw(0.5))


def test_a_recentring_while_the_head_is_lost_is_told_at_once_for_a_new_origin_alone_means_acquire_anew() -> None:
    stream = HeadStream()
    stream.pose(0, at(0.0))
    moved = rigid((1.0, 0.0, 2.0), rotations.from_yaw(0.5))
    stream.recentred(moved)
    lost, again = stream.lost(5 * MS), stream.pose(11 * MS, moved.then(at(0.0)))
    assert again is not None and again.body.tracked
    assert lost.body.origin == again.body.origin == 1
    assert lost.body.moved is not None and again.body.moved is None
    np.testing.assert_allclose(lost.body.moved.p, (1.0, 0.0, 2.0))


def test_two_recentrings_before_a_message_are_one_movement_unless_one_is_unknown() -> None:
    first, second = rigid((1.0, 0.0, 2.0), rotations.from_yaw(0.5)), rigid((0.0, 0.0, -1.0), rotations.from_yaw(1.0))
    stream = HeadStream()
    stream.pose(0, at(0.0))
    stream.recentred(first)
    stream.recentred(second)
    told = stream.pose(11 * MS, second.then(first.then(at(0.0))))
    assert told is not None and told.body.origin == 2 and told.body.moved is not None
    where = rigid(told.body.moved.p, told.body.moved.q).then(at(0.3))
    np.testing.assert_allclose(where.p, second.then(first.then(at(0.3))).p)
    stream.recentred(None)
    stream.recentred(first)
    unknown = stream.pose(22 * MS, at(0.0))
    assert unknown is not None and unknown.body.tracked and unknown.body.moved is None


def test_a_recentring_outlives_a_pose_that_the_wire_refuses() -> None:
    stream = HeadStream()
    stream.pose(0, at(0.0))
    stream.recentred(at(0.0))
    assert stream.pose(11 * MS, Rigid(np.array([math.nan, 1.6, 0.0]), UP)) is None
    told = stream.pose(22 * MS, at(2.0))
    assert told is not None and told.body.tracked and told.body.moved is not None


def test_what_is_old_or_no_place_is_left_out() -> None:
    stream = HeadStream()
    assert stream.pose(10 * MS, at(0.0)) is not None
    assert stream.pose(10 * MS, at(0.0)) is None
    assert stream.pose(9 * MS, at(0.0)) is None
    assert stream.drops["repeated"] == 2
    for p, q in (((math.nan, 0.0, 0.0), UP), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)), ((0.0, math.inf, 0.0), UP)):
        with pytest.raises(ValueError, match="finite"):
            rigid(p, q)
    assert stream.pose(20 * MS, Rigid(np.array([0.0, 1.6, 0.0]), UP)) is not None


def test_silence_is_only_silence_after_a_pose() -> None:
    stream = HeadStream()
    assert not stream.silent(10**12)
    stream.pose(0, at(0.0))
    assert not stream.silent(200 * MS)
    assert stream.silent(300 * MS)


def test_unity_s_axes_by_hand() -> None:
    # In Unity one metre ahead is +Z, and a positive turn about +Y is to the right.
    right = math.radians(30.0) / 2.0
    unity = rigid((1.0, 2.0, 3.0), (0.0, math.sin(right), 0.0, math.cos(right)))
    ours = mirrored(unity)
    np.testing.assert_allclose(ours.p, (1.0, 2.0, -3.0))
    assert rotations.yaw_of(ours.q) == pytest.approx(-math.radians(30.0))
    # Chin down: in Unity a positive turn about +X.
    nod = mirrored(rigid((0.0, 0.0, 0.0), (math.sin(0.1), 0.0, 0.0, math.cos(0.1))))
    assert rotations.rotate(nod.q, [0.0, 0.0, -1.0])[1] == pytest.approx(-math.sin(0.2))


@given(st.tuples(*[coordinates] * 3), st.tuples(*[coordinates] * 3), st.tuples(*[coordinates] * 3))
def test_mirroring_a_chain_is_the_chain_of_the_mirrored(
    p: tuple[float, ...], r: tuple[float, ...], s: tuple[float, ...]
) -> None:
    parent = rigid(p, rotations.from_rotation_vector(r))
    child = rigid(s, rotations.from_rotation_vector(p))
    there, here = mirrored(parent.then(child)), mirrored(parent).then(mirrored(child))
    np.testing.assert_allclose(there.p, here.p, atol=1e-9)
    assert rotations.angle_between(there.q, here.q) < 1e-6
    back = mirrored(mirrored(parent))
    np.testing.assert_allclose(back.p, parent.p)
    whole = parent.then(parent.inverse())
    np.testing.assert_allclose(whole.p, NOWHERE.p, atol=1e-9)
