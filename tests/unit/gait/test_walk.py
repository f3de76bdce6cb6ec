"""Ours: targets that never jump, planted feet that stand, a heading that is the pelvis's."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walkers import ANKLE, HZ, IDENTITY, WEARER, Foot, bobbing, events, feed, marching

from foottrack_protocol import Message, decode, encode
from foottrack_service.evaluation.gait_metrics import jumps_m
from foottrack_service.gait.gait import HINT_AHEAD, Gait
from foottrack_service.gait.keyframe import clip
from foottrack_service.gait.legs import pelvis_drop
from foottrack_service.gait.samples import FootSample, HeadSample
from foottrack_service.gait.settings import GaitSettings
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.presets import preset


def ours(**options):
    return Gait(WEARER, GaitSettings(**options))


def column(outs, get):
    return np.array([get(out) for _, out in outs])


def targets(outs, side):
    return column(outs, lambda out: getattr(out.ik, side).p)


def jumps(p):
    """See the metric, which has tests of its own."""
    return jumps_m(np.arange(len(p)) / HZ, p)


@pytest.mark.parametrize("peak", [0.04, 0.1, 0.35])
@pytest.mark.parametrize("cadence", [0.8, 1.6, 2.5])
def test_no_target_jumps_and_planted_feet_stand_in_the_world(cadence, peak):
    left, right = marching(cadence, peak, 6.0)
    outs = feed(ours(), left, right, 10.5)
    assert outs[-1][1].state.steps == len(left.begins) + len(right.begins)
    t = np.array([t for t, _ in outs])
    speed = column(outs, lambda out: out.ik.speed)
    moved = np.concatenate([[0.0], np.cumsum(speed[1:] * np.diff(t))])
    for side, foot in (("left", left), ("right", right)):
        p = targets(outs, side)
        assert np.max(jumps(p)) < 0.005
        assert np.max(np.linalg.norm(np.diff(p, axis=0), axis=1)) < 0.06
        down = (p[:, 1] < ANKLE + 0.003) & np.array([foot.sample(s).contact for s in t])
        world = moved - p[:, 2]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], down, [False]]).astype(int)))
        assert max(np.ptp(world[a:b]) for a, b in zip(edges[::2], edges[1::2], strict=True)) < 0.003
    assert np.min(column(outs, lambda out: out.ik.pelvis_dy)) < -0.01
    # The walk is over, and the legs are back under the hips.
    assert outs[-1][1].ik.mode == "stand"
    assert abs(outs[-1][1].ik.left.p[2]) < 0.005 > abs(outs[-1][1].ik.right.p[2])


@settings(max_examples=8, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.02, 0.4), st.floats(0.25, 0.9), st.floats(0.0, 1.2)), min_size=1, max_size=5),
    st.integers(0, 1),
)
def test_no_jump_whatever_the_peaks_the_pauses_and_the_stops(swings, first):
    t, begins = 1.0, [[], []]
    for k, (peak, swing, pause) in enumerate(swings):
        begins[(k + first) % 2].append((t, swing, peak))
        t += swing + pause
    feet = [_Uneven(Foot(-0.1 if index == 0 else 0.1, [], 1.0, 0.0), found) for index, found in enumerate(begins)]
    outs = feed(ours(), *feet, t + 3.0)
    for side in ("left", "right"):
        assert np.max(jumps(targets(outs, side))) < 0.008
    assert all(out.ik.pelvis_dy <= 0.0 <= out.ik.speed <= 3.5 for _, out in outs)
    for _, out in outs[:: HZ // 4]:
        message = Message("user", "pose/ik", "t", "s", 0, 1, 1, True, out.ik)
        assert decode(encode(message)) == message


class _Uneven:
    """A foot whose swings differ."""

    def __init__(self, foot, swings):
        self._feet = [Foot(foot.x, [begin], swing, peak) for begin, swing, peak in swings]
        self._still = foot

    def sample(self, t):
        for foot in self._feet:
            if foot.begins[0] < t < foot.begins[0] + foot.swing:
                return foot.sample(t)
        return self._still.sample(t)


def test_the_swing_goes_forward_and_never_back():
    left, right = marching(1.6, 0.15, 8.0)
    outs = feed(ours(), left, right, 8.0)
    t = np.array([t for t, _ in outs])
    ahead = -targets(outs, "left")[:, 2] + np.concatenate(
        [[0.0], np.cumsum(column(outs, lambda out: out.ik.speed)[1:] / HZ)]
    )
    for begin in left.begins[2:-1]:
        swing = ahead[(t > begin) & (t < begin + left.swing)]
        assert np.min(np.diff(swing)) > -1e-4
        assert swing[-1] - swing[0] > 0.5


@pytest.mark.parametrize(("model", "low", "high"), [("gud-wip", 0.9, 1.3), ("llcm", 0.6, 1.6), ("amplitude", 0.4, 1.6)])
def test_speed_models_agree_roughly_on_a_usual_pace(model, low, high):
    outs = feed(ours(speed=model), *marching(1.6, 0.15, 9.0), 9.0)
    speed = column(outs, lambda out: out.ik.speed)[-4 * HZ : -HZ]
    assert low < np.mean(speed) < high


def test_gud_wip_is_its_formula():
    outs = feed(ours(), *marching(1.4, 0.15, 12.0), 11.0)
    assert outs[-1][1].state.cadence == pytest.approx(1.4, abs=0.02)
    expected = ((1.4 / 1.57) * (WEARER.height / 1.72)) ** 2
    assert np.median(column(outs, lambda out: out.ik.speed)[-4 * HZ :]) == pytest.approx(expected, rel=0.03)


def test_the_cadence_of_somebody_who_limps_is_steady():
    lefts = [1.0 + 0.88 * k for k in range(8)]
    left, right = (Foot(x, begins, 0.3, 0.12) for x, begins in ((-0.1, lefts), (0.1, [b + 0.39 for b in lefts])))
    outs = feed(ours(), left, right, 7.0)
    cadence = np.array([out.state.cadence for t, out in outs if t > 2.8])
    # Step by step it would go from 2.04 to 2.56 and back.
    assert cadence == pytest.approx(2 / 0.88, rel=0.02)


def test_events_are_interpolated_and_say_which_foot_and_step():
    left, right = marching(1.6, 0.15, 6.0)
    outs = feed(ours(), left, right, 8.0)
    tops = events(outs, "mid_swing")
    true = sorted(
        [(b + left.swing / 2, "left") for b in left.begins] + [(b + right.swing / 2, "right") for b in right.begins]
    )
    assert [side for _, _, side in tops] == [side for _, side in true]
    assert [at for at, _, _ in tops] == pytest.approx([at for at, _ in true], abs=0.002)
    assert [event.step for _, out in outs for _, event in out.events if event.event == "mid_swing"] == list(
        range(1, len(true) + 1)
    )
    names = [name for _, name, side in events(outs) if side == "left"][:5]
    assert names == ["heel_off", "toe_off", "mid_swing", "terminal_swing", "foot_strike"]
    ((began, _, _),) = events(outs, "first_step")
    ((ended, _, _),) = events(outs, "stop")
    assert began == pytest.approx(1.0, abs=0.06)
    assert ended == pytest.approx(max(left.begins + right.begins) + left.swing, abs=0.06)
    assert all(at <= round(t * 1e9) for t, out in outs for at, _ in out.events)


def test_the_avatar_stops_soon_and_the_legs_return_later():
    left, right = marching(1.6, 0.15, 6.0)
    outs = feed(ours(), left, right, 10.0)
    landed = max(left.begins + right.begins) + left.swing
    stopped = next(t for t, out in outs if t > landed and out.state.cadence == 0.0)
    assert 0.2 < stopped - landed < 0.75
    moving = [t for (t, out), (_, after) in pairwise(outs) if math.dist(out.ik.left.p, after.ik.left.p) > 1e-5]
    assert not [t for t in moving if stopped + 1.0 < t < landed + 1.45]


def test_real_walking_turning_jumping_and_squats_do_not_move_the_avatar():
    walking = marching(1.8, 0.15, 6.0, shift=1.2)
    turning = marching(1.4, 0.08, 6.0, turn=0.8)
    begins = [1.0, 2.0, 3.0]
    jumping = Foot(-0.1, begins, 0.4, 0.2), Foot(0.1, begins, 0.4, 0.2)
    for left, right in (walking, turning, jumping):
        outs = feed(ours(), left, right, 8.0)
        assert max(out.ik.speed for _, out in outs) == 0.0
        assert not events(outs, "first_step")
        for side in ("left", "right"):
            assert np.max(np.abs(targets(outs, side)[:, 2])) < 1e-9
    # A jump is no step; walking and turning are.
    assert outs[-1][1].state.steps == 0
    heel_rise = [(k * 5_000_000, 0.03 * math.sin(k / 60) ** 2, 0.03 / 60 * HZ * math.sin(k / 30)) for k in range(2000)]
    gait = ours()
    for t, height, vy in heel_rise:  # both ankles rise while the toes stay: deep squats
        pitch = math.asin(height / (0.65 * 0.19))
        q = (-math.sin(pitch / 2), 0.0, 0.0, math.cos(pitch / 2))
        drop = 0.09 * (1 - math.cos(pitch))
        out = gait.update(
            t, *(FootSample((x, ANKLE + height - drop, 0.0), q, (0.0, vy, 0.0), True) for x in (-0.1, 0.1)), None, 0.0
        )
        assert not out.events
    assert out.state.steps == 0


@pytest.mark.parametrize("first", [0.30, 0.36, 0.40])
def test_a_turn_on_the_spot_that_begins_gently_and_ends_gently_is_no_walk(first):
    left, right = marching(1.4, 0.11, 5.0, begin=1.0, turn=0.8)
    turns = [first] + [0.8] * (len(left.begins) + len(right.begins) - 2) + [first]
    begins = sorted((begin, foot) for foot in (left, right) for begin in foot.begins)
    for foot in (left, right):
        foot.turns = [turn for turn, (_, owner) in zip(turns, begins, strict=True) if owner is foot]
    outs = feed(ours(), left, right, 7.0)
    assert outs[-1][1].state.steps == len(begins)
    assert not events(outs, "first_step")
    assert max(out.ik.speed for _, out in outs) == 0.0


@pytest.mark.parametrize("turn", [0.1, 0.2, 0.33])
def test_whoever_turns_while_walking_in_place_walks_from_the_second_step_on(turn):
    left, right = marching(1.7, 0.15, 6.0, turn=turn)
    outs = feed(ours(), left, right, 8.0)
    assert outs[-1][1].state.steps == len(left.begins) + len(right.begins)
    ((began, _, _),) = events(outs, "first_step")
    assert began < sorted(left.begins + right.begins)[1] + 0.1
    assert np.median(column(outs, lambda out: out.ik.speed)[3 * HZ : 5 * HZ]) > 0.8


def test_from_walking_in_place_to_walking_through_the_room():
    place, room = marching(1.7, 0.15, 4.0), marching(1.7, 0.12, 9.0, begin=4.3, shift=1.1)

    def both(a, b):
        class Both:
            def sample(self, t):
                return a.sample(t) if t < 4.25 else b.sample(t)

        return Both()

    outs = feed(ours(), both(place[0], room[0]), both(place[1], room[1]), 9.0)
    left_for_good = next(t for t, _, _ in events(outs, "stop"))
    assert 3.5 < left_for_good < 5.2
    # The avatar is not moved a second time.
    late = [out.ik.speed for t, out in outs if t > left_for_good + 1.0]
    assert max(late) < 0.01
    for side in ("left", "right"):
        assert np.max(jumps(targets(outs, side))) < 0.008


def test_heading_is_the_pelvis_s():
    left, right = marching(1.6, 0.15, 3.0)
    gait = ours()
    for k in range(2 * HZ):
        t, yaw = k / HZ, 0.004 * k
        out = gait.update(round(t * 1e9), left.sample(t), right.sample(t), None, yaw)
        assert out.ik.heading == pytest.approx((-math.sin(yaw), 0.0, -math.cos(yaw)))


def test_a_foot_that_is_lost_in_the_air_does_not_drop_its_target():
    left, right = marching(1.0, 0.3, 6.0)
    gait, heights = ours(), []
    gone = left.begins[1] + left.swing / 2
    for k in range(6 * HZ):
        t = k / HZ
        seen = None if gone < t < gone + 0.8 else left.sample(t)
        out = gait.update(round(t * 1e9), seen, right.sample(t), None, 0.0)
        heights.append(out.ik.left.p[1])
        assert (out.state.left is None) == (seen is None)
    assert np.max(np.abs(np.diff(heights))) < 0.035


def test_one_foot_alone_is_enough_for_its_gait():
    left, _ = marching(1.6, 0.15, 6.0)
    outs = feed(ours(), left, None, 8.0)
    assert outs[-1][1].state.right is None
    assert len(events(outs, "foot_strike")) == len(left.begins)


@pytest.mark.parametrize("hz", [1.5, 1.9, 2.3])
def test_steps_from_the_headset_alone(hz):
    outs = feed(ours(), None, None, 13.0, head=bobbing(hz, 0.06, until=10.0))
    during = [out.state.cadence for t, out in outs if 5.0 < t < 9.5]
    assert np.median(during) == pytest.approx(hz, abs=0.1)
    assert outs[-1][1].state.left is None
    assert outs[-1][1].ik.mode == "stand"
    assert {side for _, _, side in events(outs, "toe_off")} == {"left", "right"}
    for side in ("left", "right"):
        assert np.max(jumps(targets(outs, side))) < 0.008
    quiet = feed(ours(headset_alone=False), None, None, 9.0, head=bobbing(hz, 0.06))
    assert max(out.ik.speed for _, out in quiet) == 0.0


@pytest.mark.parametrize(("hz", "size"), [(1.8, 0.004), (0.3, 0.4), (0.25, 0.05)])
def test_a_head_that_breathes_or_squats_does_not_walk(hz, size):
    outs = feed(ours(), None, None, 12.0, head=bobbing(hz, size))
    assert max(out.ik.speed for _, out in outs) == 0.0


def test_key_frames_play_while_a_foot_moves_and_are_not_synchronised():
    gait = ours(mode="keyframe")
    left, right = marching(1.6, 0.15, 6.0)
    outs = feed(gait, left, right, 9.0)
    z = targets(outs, "left")[:, 2]
    assert np.ptp(z) > 0.5
    assert outs[-1][1].ik.left.p[2] == pytest.approx(0.0)
    user = np.array([left.height(t) for t, _ in outs])
    avatar = targets(outs, "left")[:, 1] - ANKLE
    walking = slice(2 * HZ, 6 * HZ)
    ours_y = targets(feed(ours(), left, right, 9.0), "left")[walking, 1]
    assert np.corrcoef(user[walking], ours_y)[0, 1] > 0.98
    assert np.corrcoef(user[walking], avatar[walking])[0, 1] < 0.7


def test_the_clip_is_the_walk_cycle_of_the_preset():
    frames, cycle = clip(0.86), build_cycle(preset("animator"))
    assert len(frames) == 24
    strike, up = frames[0], max(frames, key=lambda frame: frame.y)
    assert strike.pitch > 0.3  # on the heel
    assert strike.z == max(frame.z for frame in frames[:12])
    # The planted foot goes back by half a stride in half a period, and the swing passes ahead of the contact.
    assert frames[3].z - frames[7].z == pytest.approx(cycle.stride * 4 / 24 * 0.86 / cycle.body.leg, rel=0.02)
    assert frames[5].y == pytest.approx(0.0, abs=0.002)
    assert 0.08 < up.y < 0.2
    assert clip(0.43)[9].y == pytest.approx(0.5 * frames[9].y)


def test_hints_lie_before_the_knees_and_the_pelvis_comes_down_by_equation_5():
    assert pelvis_drop(0.86, 0.3, -0.4) == pytest.approx(0.86 - math.sqrt(0.86**2 - 0.16))
    outs = feed(ours(), *marching(1.6, 0.15, 6.0), 6.0)
    for _, out in outs[::17]:
        for foot in (out.ik.left, out.ik.right):
            assert foot.hint[2] == pytest.approx(0.5 * foot.p[2] - HINT_AHEAD)
            assert foot.p[1] < foot.hint[1] < ANKLE + WEARER.leg
        worst = max(abs(out.ik.left.p[2]), abs(out.ik.right.p[2]))
        assert out.ik.pelvis_dy == pytest.approx(-pelvis_drop(WEARER.leg, worst, 0.0))


def test_stamps_that_repeat_or_fall_and_long_pauses_do_no_harm():
    gait = ours()
    left, right = marching(1.6, 0.15, 4.0)
    for t in (0.0, 0.0, 1.0, 0.5, 1.1, 1.1, 9.0, 9.005):
        out = gait.update(round(t * 1e9), left.sample(t), right.sample(t), HeadSample((0.0, 1.6, 0.0), IDENTITY), 0.0)
        assert math.isfinite(out.ik.speed) and math.isfinite(out.ik.left.p[2])
