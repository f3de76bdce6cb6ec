"""A walk on the wire: its frame, its truth, its events."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.path import parse_path
from foottrack_service.walkcycle.presets import PRESETS, preset
from foottrack_service.walkcycle.walk import Walk, walk_along
from foottrack_service.walkcycle.wire import body_track, stage_place, stage_rotation, wire_events, wire_instants


def _walk(name: str = "normative", path: str = "line:3.5") -> Walk:
    return walk_along(build_cycle(preset(name)), parse_path(path))


def test_the_stage_is_the_model_turned_round() -> None:
    q = rot.from_rotation_vector([0.3, -0.4, 0.9])
    half = rot.from_yaw(np.pi)
    assert stage_place([1.0, 2.0, 3.0]) == pytest.approx([-1.0, 2.0, -3.0])
    assert stage_place([1.0, 2.0, 3.0]) == pytest.approx(rot.rotate(half, [1.0, 2.0, 3.0]))
    assert stage_rotation(q) == pytest.approx(rot.multiply(rot.multiply(half, q), rot.conjugate(half)))


@pytest.mark.parametrize("path", ["line:3.5", "line:3.5,70", "circle:1.5,200"])
def test_on_the_stage_it_walks_towards_its_face_which_is_minus_z(path: str) -> None:
    walk = _walk(path=path)
    times = walk.times(50.0)
    track = body_track(walk, times)
    velocity = np.gradient(track.hips, times, axis=0)
    moving = np.linalg.norm(velocity, axis=1) > 0.8
    ahead = rot.rotate(track.hips_rotation, [0.0, 0.0, -1.0])
    assert np.mean(np.sum(ahead * velocity, axis=1)[moving]) > 0.8
    for side, sign in (("left", -1.0), ("right", 1.0)):
        foot = track.feet[side]
        toe = rot.unrotate(foot.rotation, foot.toe - foot.ankle)
        assert np.all(toe[:, 2] < -0.1)
        beside = rot.unrotate(track.hips_rotation, foot.hip - track.hips)
        assert np.all(sign * beside[:, 0] > 0.05)


@pytest.mark.parametrize("name", PRESETS)
def test_bodies_are_those_of_a_person(name: str) -> None:
    walk = _walk(name)
    times = walk.times(100.0)
    instants = list(wire_instants(walk, times))
    assert len(instants) == len(times)
    ankles = np.array([i.pose.left.ankle.p for i in instants if i.pose.left is not None])
    said = np.array([i.pose.left.v for i in instants if i.pose.left is not None])
    assert np.max(np.abs(np.gradient(ankles, times, axis=0) - said)[2:-2]) < 0.5
    assert np.max(np.abs(0.5 * (said[1:] + said[:-1]) - np.diff(ankles, axis=0) / 0.01)) < 0.3
    for instant in instants:
        for foot, target in ((instant.pose.left, instant.ik.left), (instant.pose.right, instant.ik.right)):
            assert foot is not None
            assert target.p[1] == pytest.approx(foot.ankle.p[1])
            if foot.contact:
                low = min(foot.ankle.p[1], foot.toe[1])
                assert low < 0.2
        assert instant.ik.pelvis_dy <= 0.0
        assert np.linalg.norm(instant.ik.heading) == pytest.approx(1.0)
    steps = [i.gait.steps for i in instants]
    assert steps == sorted(steps)
    assert instants[0].ik.mode == "stand"
    assert instants[len(instants) // 2].ik.mode == "walk"


def test_events_come_in_the_order_of_a_step() -> None:
    walk = _walk()
    events = wire_events(walk)
    assert [t for t, _ in events] == sorted(t for t, _ in events)
    assert [e.event for _, e in events].count("first_step") == 1
    assert events[-1][1].event == "stop"
    assert events[-1][0] == pytest.approx(walk.duration)
    strikes = [e for _, e in events if e.event == "foot_strike"]
    assert [e.step for e in strikes] == list(range(1, len(strikes) + 1))
    assert all(a.side != b.side for a, b in pairwise(strikes))
    for number, strike in enumerate(strikes, start=1):
        own = [e.event for _, e in events if e.step == number and e.side == strike.side and e.event != "first_step"]
        assert own == ["heel_off", "toe_off", "mid_swing", "terminal_swing", "foot_strike"]


def test_an_event_is_what_the_foot_does_then() -> None:
    walk = _walk()
    for t, event in wire_events(walk):
        if event.side is None or event.event not in ("foot_strike", "toe_off", "mid_swing"):
            continue
        before, at, after = (body_track(walk, [t + d]).feet[event.side] for d in (-0.02, 0.0, 0.02))
        lowest = [min(f.heel[0, 1], f.toe[0, 1]) for f in (before, at, after)]
        if event.event == "foot_strike":
            assert lowest[1] == pytest.approx(0.0, abs=5e-4)
            assert lowest[0] > 1e-5
        elif event.event == "toe_off":
            assert lowest[1] == pytest.approx(0.0, abs=5e-4)
            assert after.ankle[0, 1] > at.ankle[0, 1]
        else:
            assert at.ankle[0, 1] >= max(before.ankle[0, 1], after.ankle[0, 1]) - 1e-4


def test_instants_may_come_in_any_order() -> None:
    walk = _walk(path="circle:1,180")
    times = walk.times(60.0)
    shuffled = np.random.default_rng(4).permutation(times)
    one, two = body_track(walk, times), body_track(walk, shuffled)
    order = np.argsort(shuffled)
    assert np.array_equal(one.feet["left"].ankle, two.feet["left"].ankle[order])
    assert np.array_equal(one.head, two.head[order])
