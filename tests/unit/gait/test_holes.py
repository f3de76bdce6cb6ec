"""Data that stop for a while, at any moment of a walk: the legs stay possible, and come back without a jump."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walkers import ANKLE, WEARER, marching

from foottrack_service.body.skeleton import Skeleton
from foottrack_service.config import Settings
from foottrack_service.evaluation.gait_metrics import jumps_m
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.gait_link import wearer
from foottrack_service.fusion.offline import fuse
from foottrack_service.gait.gait import Gait
from foottrack_service.gait.legs import pelvis_drop
from foottrack_service.gait.settings import GaitSettings
from foottrack_service.simulation.scenario import simulate

HZ, TICK_S, LOST_S = 100, 0.02, 2.0
FARTHEST = 0.7 * WEARER.leg


def through_a_hole(cadence, peak, begin, gap, ticks, drift, seconds=7.0):
    """(t, z left, z right), targets and pelvis_dy of a walk whose data stop at ``begin`` for ``gap`` s.

    ``ticks``: in the hole the timer publishes on, what fusion holds coasts on with the last velocity, which dies away,
    and the feet are given up after 2 s. ``drift`` m/s: what fusion's velocity is off by after the hole, for 0.3 s.
    """
    feet = marching(cadence, peak, seconds)
    gait, rows = Gait(WEARER, GaitSettings()), []
    t = 0.0
    while t < max(seconds, begin + gap + 2.5):
        since = t - begin
        samples = [foot.sample(t) for foot in feet]
        if 0.0 < since < gap:
            flown = 0.3 * (1.0 - math.exp(-since / 0.3))
            samples = [_off(foot.sample(begin), flown, math.exp(-since / 0.3)) for foot in feet]
        elif 0.0 < since - gap < 0.3:
            samples = [foot._replace(v=(0.0, foot.v[1] + drift, 0.0), contact=False) for foot in samples]
            samples = [f._replace(p=(f.p[0], f.p[1] + drift * (since - gap), f.p[2])) for f in samples]
        if 0.0 < since < gap and since > LOST_S:
            samples = [None, None]
        out = gait.update(round(t * 1e9), *samples, None, 0.0)
        rows.append((t, -out.ik.left.p[2], out.ik.left.p[1], -out.ik.right.p[2], out.ik.right.p[1], out.ik.pelvis_dy))
        t += 1.0 / HZ
        if 0.0 < t - begin < gap:
            t = t - 1.0 / HZ + TICK_S if ticks else begin + gap + 1e-6
    return np.array(rows)


def _off(foot, flown, fading):
    vx, vy, vz = foot.v
    x, y, z = foot.p
    return foot._replace(p=(x, y + vy * flown, z), v=(vx * fading, vy * fading, vz * fading))


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from([(0.8, 0.2), (1.6, 0.05), (2.0, 0.15), (2.5, 0.1), (2.5, 0.35)]),
    st.floats(3.0, 4.3),
    st.one_of(st.floats(0.05, 1.0), st.floats(1.0, 6.0)),
    st.booleans(),
    st.one_of(st.just(0.0), st.floats(-2.0, 2.0)),
)
def test_legs_stay_possible_across_a_hole_and_come_back_without_a_jump(walk, begin, gap, ticks, drift):
    rows = through_a_hole(*walk, begin, gap, ticks, drift)
    t, z = rows[:, 0], rows[:, [1, 3]]
    assert np.max(np.abs(z)) <= FARTHEST + 1e-9
    assert np.min(rows[:, 5]) >= -pelvis_drop(WEARER.leg, FARTHEST, 0.0) - 1e-9
    assert np.min(rows[:, [2, 4]]) >= ANKLE - 1e-9
    assert np.max(rows[:, [2, 4]]) < ANKLE + walk[1] + 1.0
    after = t[1:] > begin + gap + 1.5 / HZ
    for foot in (rows[:, 1:3], rows[:, 3:5]):
        assert np.max(jumps_m(t, foot)[after]) < (0.012 if drift else 0.004)


@pytest.mark.parametrize(("kept", "begin", "gap"), [("late", 6.74, 0.6), ("drop", 6.37, 0.3)])
def test_what_fusion_makes_of_a_hole_leaves_the_legs_possible(kept, begin, gap):
    chosen = Settings()
    arrivals = list(simulate("walk-in-place", 3, settings=chosen, seconds=begin + gap + 1.0).messages())
    low = arrivals[0][0] + round(begin * 1e9)
    high = low + round(gap * 1e9)
    if kept == "late":
        arrivals = [(max(at, high) if at > low else at, message) for at, message in arrivals]
    else:
        arrivals = [(at, message) for at, message in arrivals if not low < at < high]
    targets = [found.data for found in fuse(iter(arrivals), FusionCore(chosen)) if found.stream == "pose/ik"]
    leg = wearer(chosen, Skeleton.of(chosen.body)).leg
    assert max(out.speed for out in targets) > 1.0
    assert max(abs(foot.p[2]) for out in targets for foot in (out.left, out.right)) < 0.7 * leg
    assert min(out.pelvis_dy for out in targets) > -pelvis_drop(leg, 0.7 * leg, 0.0)
