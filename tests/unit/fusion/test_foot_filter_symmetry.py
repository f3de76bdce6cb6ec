"""A turned room, a turned sensor and mirrored feet give turned, same and mirrored results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from foot_runs import START, Run, run
from hypothesis import given, settings
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings, Placement
from foottrack_service.fusion.foot_filter import ErrorStateFilter
from foottrack_service.fusion.interface import HeadSample, ImuSample, OpticalFix
from foottrack_service.rotations import Array
from foottrack_service.simulation.scenario import simulate

SETTLED_S = 1.0
TURNED_ROOM_M, TURNED_ROOM_RAD = 1e-3, 2e-3
"""A foot begins with its toes towards -Z of any room: what is left of that first guess after SETTLED_S, no more."""
ROUNDING_M, ROUNDING_RAD = 1e-9, 1e-9
"""What is the same but for the order of sums may differ by rounding, and by gates' decisions not at all."""
MIRROR = np.array([-1.0, 1.0, 1.0])
MIRROR_TURN = np.array([1.0, -1.0, -1.0])
"""Of rates, and of a quaternion's vector part."""
SCENARIOS = {
    kind: simulate("steps", 21, seconds=3.0, imu_hz=200.0, imu=kind, start=START, depth=False)
    for kind in ("fused", "raw")
}
Change = Callable[[object], object]
rotation_vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


def fused(kind: str, change: Change | None = None, foot: FootSettings | None = None, side: str = "left") -> Run:
    """The left foot of a scenario through a filter for ``side``."""
    return run(lambda: ErrorStateFilter(foot or FootSettings(), side), SCENARIOS[kind], "left", change)


@cache
def plain(kind: str) -> Run:
    """The left foot as it is."""
    return fused(kind)


def settled(found: Run) -> tuple[Array, Array, Array, Array]:
    """Places, attitudes, velocities and radii after SETTLED_S."""
    chosen = [e for t, e in zip(found.t, found.estimates, strict=True) if t > SETTLED_S]
    assert len(chosen) > 300
    p, q, v, sigma = zip(*((e.p, e.q, e.v, e.sigma) for e in chosen), strict=True)
    return np.array(p), np.array(q), np.array(v), np.array(sigma)


def in_room(turn: Array, shift: Array) -> Change:
    """The room's origin and forward are other ones: only the head's pose says so."""

    def moved(head: HeadSample) -> HeadSample:
        return HeadSample(head.t, rot.rotate(turn, head.p) + shift, rot.multiply(turn, head.q))

    def change(each: object) -> object:
        if isinstance(each, OpticalFix):
            return replace(each, head=moved(each.head), head_at_arrival=moved(each.head_at_arrival))
        return each

    return change


def on_sensor(turn: Array) -> Change:
    """The sensor is glued on turned by ``turn`` against where it was."""

    def change(each: object) -> object:
        if not isinstance(each, ImuSample):
            return each
        gyro = None if each.gyro is None else rot.unrotate(turn, each.gyro)
        q = None if each.q is None else rot.multiply(each.q, turn)
        return ImuSample(each.t, rot.unrotate(turn, each.acc), gyro, q)

    return change


def mirrored(each: object) -> object:
    """The same seen in a mirror in the plane x = 0."""

    def turned(q: Array | None) -> Array | None:
        return None if q is None else np.array([*(MIRROR_TURN * q[:3]), q[3]])

    def head(h: HeadSample) -> HeadSample:
        q = turned(h.q)
        assert q is not None
        return HeadSample(h.t, MIRROR * h.p, q)

    if isinstance(each, ImuSample):
        return ImuSample(
            each.t, MIRROR * each.acc, None if each.gyro is None else MIRROR_TURN * each.gyro, turned(each.q)
        )
    assert isinstance(each, OpticalFix)
    return replace(
        each,
        p=MIRROR * each.p,
        q=turned(each.q),
        q_alt=turned(each.q_alt),
        cov=np.outer(MIRROR, MIRROR) * each.cov,
        head=head(each.head),
        head_at_arrival=head(each.head_at_arrival),
    )


@pytest.mark.parametrize("kind", ["fused", "raw"])
@settings(max_examples=5, deadline=None)
@given(yaw=st.floats(-3.1, 3.1), east=st.floats(-5.0, 5.0), south=st.floats(-5.0, 5.0))
def test_a_turned_room_gives_turned_results(kind: str, yaw: float, east: float, south: float) -> None:
    turn, shift = rot.from_yaw(yaw), np.array([east, 0.0, south])
    p, q, v, sigma = settled(plain(kind))
    their_p, their_q, their_v, their_sigma = settled(fused(kind, in_room(turn, shift)))
    assert np.abs(their_p - shift - rot.rotate(turn, p)).max() < TURNED_ROOM_M
    assert np.max(rot.angle_between(their_q, rot.multiply(turn, q))) < TURNED_ROOM_RAD
    assert np.abs(their_v - rot.rotate(turn, v)).max() < 20.0 * TURNED_ROOM_M
    assert their_sigma == pytest.approx(sigma, rel=0.02)


@pytest.mark.parametrize("kind", ["fused", "raw"])
@settings(max_examples=5, deadline=None)
@given(turn=rotation_vectors)
def test_a_turned_sensor_gives_the_same_results(kind: str, turn: Array) -> None:
    m = rot.from_rotation_vector(turn)
    x, y, z, w = m.tolist()
    foot = FootSettings(imu=Placement(q=(x, y, z, w)))
    p, q, v, sigma = settled(plain(kind))
    their_p, their_q, their_v, their_sigma = settled(fused(kind, on_sensor(m), foot))
    assert np.abs(their_p - p).max() < ROUNDING_M
    assert np.max(rot.angle_between(their_q, q)) < ROUNDING_RAD
    assert np.abs(their_v - v).max() < 20.0 * ROUNDING_M
    assert their_sigma == pytest.approx(sigma, rel=1e-4)


@pytest.mark.parametrize("kind", ["fused", "raw"])
def test_mirrored_feet_give_mirrored_results(kind: str) -> None:
    p, q, v, sigma = settled(plain(kind))
    their_p, their_q, their_v, their_sigma = settled(fused(kind, mirrored, side="right"))
    back = np.concatenate([their_q[:, :3] * MIRROR_TURN, their_q[:, 3:]], axis=1)
    assert np.abs(their_p * MIRROR - p).max() < ROUNDING_M
    assert np.max(rot.angle_between(back, q)) < ROUNDING_RAD
    assert np.abs(their_v * MIRROR - v).max() < 20.0 * ROUNDING_M
    assert their_sigma == pytest.approx(sigma, rel=1e-4)
