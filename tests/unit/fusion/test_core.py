"""The fusion core: what brings on an output, what is refused, and that nothing bad gets out."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foottrack_protocol import Message, decode, encode
from foottrack_protocol import messages as m
from foottrack_protocol.frames import STANDARD_GRAVITY, TAG_ON_INSTEP
from foottrack_service import rotations as rot
from foottrack_service.config import FusionSettings, Settings
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.filters import make_filter
from foottrack_service.fusion.offline import fuse

MS = 1_000_000
G = STANDARD_GRAVITY
IDENTITY = (0.0, 0.0, 0.0, 1.0)


def message(stream, t, data, valid=True, user="user"):
    return Message(user, stream, "test", "s", 0, t, t, valid, data)


def imu(t, side="left", acc=(0.0, G, 0.0), q=IDENTITY, valid=True, user="user"):
    return message(f"imu/{side}", t, m.Imu(acc=acc, q=q, t_arr=t), valid, user)


def head(t, p=(0.0, 1.6, 0.0), tracked=True, origin=0, moved=None):
    body = m.HeadPose(p=p, q=IDENTITY, tracked=tracked, origin=origin, moved=moved)
    return message("head/pose", t, body)


def marker(t, p, side="left", q=None):
    body = m.Optical(p=p, q=q, cov=(1e-4, 0, 0, 1e-4, 0, 1e-4), edge_px=50.0, frame=0)
    return message(f"marker/{side}", t, body)


AT_ONCE = Settings(fusion=FusionSettings(filter="reference"))
"""The reference filter believes the first fix; ours wants fixes that agree."""


def bodies(outs):
    return [out for out in outs if out.stream == "pose/body"]


def feed(core, messages):
    return bodies(out for each in messages for out in core.handle(each, each.t))


def tick(core, now):
    return bodies(core.tick(now))


def test_an_imu_alone_brings_its_foot_and_no_legs():
    (out,) = feed(FusionCore(Settings()), [imu(0)])
    assert (out.topic, out.src, out.sid, out.seq, out.t, out.t_pub) == ("user/pose/body", "fusion", "offline", 0, 0, 0)
    body = out.data
    assert (body.head, body.hips, body.right) == (None, None, None)
    assert (body.left.hip, body.left.knee) == (None, None)
    assert np.allclose(body.left.ankle.p, (-0.1, 0.09, 0.0))
    assert np.allclose(body.left.toe, (-0.1, 0.02, -0.19))


def test_head_and_tags_alone_bring_legs():
    core = FusionCore(AT_ONCE)
    outs = feed(core, [head(0), marker(0, (-0.1, -1.5, -0.15)), marker(0, (0.1, -1.5, -0.15), side="right")])
    outs += tick(core, core.deadline)
    body = outs[-1].data
    assert body.head.p == (0.0, 1.6, 0.0)
    assert body.left.stage == body.right.stage == "marker"
    skeleton = core._body.skeleton
    for leg in (body.left, body.right):
        assert math.dist(leg.hip, leg.knee) == pytest.approx(skeleton.thigh)
        assert math.dist(leg.knee, leg.ankle.p) == pytest.approx(skeleton.shank)
        assert leg.knee[2] < max(leg.hip[2], leg.ankle.p[2])
    assert math.dist(body.left.hip, body.right.hip) == pytest.approx(skeleton.hip_width)


def test_outputs_come_on_data_but_no_faster_than_the_limit_and_by_the_timer_in_silence():
    core = FusionCore(Settings())
    stamps = [out.t for out in feed(core, [imu(t * MS) for t in (0, 2, 4, 5, 9, 10, 30)])]
    assert stamps == [0, 5 * MS, 10 * MS, 30 * MS]
    assert core.deadline == 50 * MS
    assert core.tick(49 * MS) == []
    (out,) = tick(core, 50 * MS)
    assert out.t == 50 * MS


def test_offline_the_timer_runs_in_virtual_time():
    outs = bodies(fuse([(each.t, each) for each in (imu(0), imu(65 * MS))], FusionCore(Settings())))
    assert [out.t // MS for out in outs] == [0, 20, 40, 60, 65]
    assert [out.seq for out in outs] == [0, 1, 2, 3, 4]


def test_nothing_is_published_before_something_is_known():
    core = FusionCore(Settings())
    assert core.deadline is None
    assert core.tick(10**12) == []


def test_invalid_messages_and_other_users_are_not_used():
    core = FusionCore(Settings())
    assert feed(core, [imu(0, valid=False), imu(0, user="other")]) == []
    assert core.health["user/left"].rejected == {"invalid": 1}


@pytest.mark.parametrize("acc", [(1e300, 0.0, 0.0), (0.0, -1e5, 0.0)])
def test_what_no_foot_can_feel_is_counted_and_left_out(acc):
    core = FusionCore(Settings())
    feed(core, [imu(0), imu(10 * MS, acc=acc)])
    assert core.health["user/left"].rejected == {"implausible": 1}
    assert core.health["user/left"].accepted == {"imu": 1}


def test_a_sample_from_the_past_is_counted_as_such():
    core = FusionCore(Settings())
    feed(core, [imu(0), imu(10 * MS)])
    for t in (10 * MS, 5 * MS):
        core.handle(imu(t), 20 * MS)
    assert core.health["user/left"].accepted == {"imu": 2}
    assert core.health["user/left"].rejected == {"imu_stale": 2}


@pytest.mark.parametrize("broken", ["p", "sigma"])
def test_a_filter_that_lost_its_numbers_begins_again_and_never_speaks_them(broken):
    made = []

    def make(settings, side):
        filter_ = make_filter(settings, side)
        if not made:
            sound = filter_.estimate
            wrong = math.nan if broken == "sigma" else np.full(3, math.nan)
            filter_.estimate = lambda t: (found := sound(t)) and replace(found, **{broken: wrong})
        made.append(side)
        return filter_

    core = FusionCore(Settings(), make=make)
    outs = feed(core, [imu(0), imu(10 * MS), imu(20 * MS)])
    assert [out.data.left is None for out in outs] == [True, False, False]
    assert made == ["left", "right", "left"]
    assert core.health["user/left"].rejected == {"not_finite": 1}


def body_values(**wrong):
    values = {"height": 1.8, "thigh": 0.5, "shank": 0.4, "torso": 0.7, "hip_width": 0.3, "hip_back": 0.1}
    return m.BodyCalibration(values=m.BodyValues(**{**values, **wrong}))


def mount_values(p=(0.0, 0.0, 0.0), sigma_p=1e-3, sigma_q=1e-3):
    base = Settings().camera.mount_hash
    return m.MountCalibration(values=m.MountValues(p=p, q=IDENTITY, sigma_p=sigma_p, sigma_q=sigma_q, base=base))


def imu_values(side="left", acc_bias=(0, 0, 0), gyro_bias=(0, 0, 0), p=(0, 0, 0)):
    return m.ImuCalibration(values=m.ImuValues(side=side, acc_bias=acc_bias, gyro_bias=gyro_bias, p=p, q=IDENTITY))


@pytest.mark.parametrize(
    "found",
    [
        m.FloorCalibration(values=m.FloorValues(height=1.7e308)),
        m.HeadingCalibration(values=m.HeadingValues(yaw=0.0, imu_yaw=m.PerSideYaw(left=-1e308))),
        body_values(shank=0.0),
        body_values(thigh=1.7e308),
        body_values(hip_back=-1e308),
        mount_values(p=(0.0, 1.7e308, 0.0)),
        mount_values(sigma_p=1e300),
        mount_values(sigma_q=1e300),
        imu_values(p=(1e300, 0, 0)),
        imu_values(acc_bias=(0, -1e308, 0)),
        imu_values(gyro_bias=(0, 0, 1e308)),
    ],
    ids=lambda found: found.kind,
)
def test_a_calibration_of_nobody_stops_nothing_is_counted_and_left_out(found, caplog):
    def run(core, calibrations):
        outs = feed(core, [head(0), imu(0)])
        for t in range(10 * MS, 400 * MS, 10 * MS):
            outs += feed(core, [head(t), imu(t), marker(t, (-0.1, -1.55, -0.15), q=TAG_ON_INSTEP)])
            outs += feed(core, [message("calibration", t, each) for each in calibrations])
        return outs

    core = FusionCore(Settings())
    outs = run(core, [found])
    assert [found.kind in record.getMessage() for record in caplog.records] == [True]
    assert [decode(encode(out)) for out in outs] == run(FusionCore(Settings()), [])
    assert core.health["user/left"].rejected["implausible"] == 39
    assert core.health["user/right"].rejected == ({} if found.kind == "imu" else {"implausible": 39})


def test_a_head_that_is_nowhere_or_is_not_sure_is_counted():
    core = FusionCore(Settings())
    outs = feed(core, [head(0), imu(0), head(5 * MS, p=(0.0, 1e300, 0.0)), imu(10 * MS)])
    assert outs[0].data.head is not None and outs[-1].data.head is None
    core.handle(head(15 * MS)._replace(valid=False), 15 * MS)
    for side in ("left", "right"):
        assert core.health[f"user/{side}"].rejected == {"implausible": 1, "invalid": 1}


def test_what_is_never_fused_is_not_counted():
    core = FusionCore(Settings())
    core.handle(message("truth/left", 10**12, m.Truth(p=(0.0, 0.0, 0.0), q=IDENTITY)), 0)
    assert core.health["user/left"].rejected == {}


def test_a_stage_that_moved_by_more_than_there_is_is_one_that_moved_nobody_knows_how():
    results = []
    for moved in (None, m.Pose(p=(1.7e308, -1.7e308, 0.0), q=tuple(rot.from_yaw(0.5).tolist()))):
        core = FusionCore(Settings())
        outs = feed(core, [head(0), imu(0), imu(0, "right"), head(2 * MS, p=(5.0, 1.6, 5.0), origin=1, moved=moved)])
        for t in range(10 * MS, 400 * MS, 10 * MS):
            outs += feed(core, [head(t, p=(5.0, 1.6, 5.0), origin=1), imu(t), imu(t, "right")])
        results.append(outs)
    assert results[0] == results[1]


def test_a_fix_without_a_head_is_rejected_as_such():
    core = FusionCore(Settings())
    feed(core, [imu(0), marker(0, (0.0, -1.5, 0.0))])
    assert core.health["user/left"].rejected == {"no_head_pose": 1}


def test_without_a_fresh_head_legs_are_nil_and_feet_still_come():
    core = FusionCore(Settings())
    outs = feed(core, [head(0), imu(10 * MS), imu(200 * MS)])
    assert outs[-2].data.hips is not None
    assert outs[-1].data.hips is None and outs[-1].data.left is not None


def test_a_known_recentring_moves_everything_rigidly():
    core = FusionCore(Settings())
    turn = rot.from_yaw(0.5)
    moved = m.Pose(p=(1.0, 0.0, -2.0), q=tuple(turn.tolist()))
    before = feed(core, [head(0), marker(0, (-0.1, -1.5, -0.15)), imu(10 * MS)])[-1]
    core.handle(
        head(12 * MS, p=tuple(np.array([1, 0, -2]) + rot.rotate(turn, [0, 1.6, 0])), origin=1, moved=moved), 12 * MS
    )
    after = tick(core, core.deadline)[-1]
    expected = np.array([1, 0, -2]) + rot.rotate(turn, before.data.left.ankle.p)
    assert np.allclose(after.data.left.ankle.p, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("arrives_ms", "counts_in"),
    [(21, ["marker", "marker"]), (28, ["lost", "marker"])],
    ids=["time before the next sample", "in the next sample's way"],
)
def test_a_picture_is_never_in_the_way_of_a_samples_pose(arrives_ms, counts_in):
    core = FusionCore(AT_ONCE)
    feed(core, [head(0), imu(0), imu(10 * MS), imu(20 * MS), head(21 * MS)])
    fix = marker(15 * MS, (-0.1, -1.5, -0.15))
    assert core.handle(fix, arrives_ms * MS) == []
    assert core.health["user/left"].accepted.get("marker", 0) == (counts_in[0] == "marker")
    poses = feed(core, [imu(30 * MS), imu(40 * MS)])
    assert [pose.data.left.stage for pose in poses] == counts_in


def test_a_picture_does_not_wait_for_a_sample_that_is_lost():
    core = FusionCore(AT_ONCE)
    feed(core, [head(0), imu(0), imu(10 * MS), head(16 * MS)])
    core.handle(marker(15 * MS, (-0.1, -1.5, -0.15)), 18 * MS)
    (pose,) = tick(core, core.deadline)
    assert (pose.t, pose.data.left.stage) == (30 * MS, "marker")
    core.handle(marker(16 * MS, (-0.1, -1.5, -0.15)), 41 * MS)
    assert core.health["user/left"].accepted["marker"] == 2


def test_an_unknown_recentring_begins_again_and_never_drifts_across():
    core = FusionCore(AT_ONCE)
    feed(core, [head(0), marker(0, (-0.1, -1.5, -0.15)), head(2 * MS, p=(5.0, 1.6, 5.0), origin=1)])
    assert tick(core, core.deadline)[-1].data.left is None
    out = feed(core, [marker(40 * MS, (-0.1, -1.5, -0.15)), imu(41 * MS)])[-1]
    assert math.dist(out.data.left.ankle.p, (4.9, 0.1, 5.0)) < 0.2


def test_calibrations_are_applied_when_they_arrive():
    core = FusionCore(Settings())
    values = m.BodyValues(height=1.8, thigh=0.5, shank=0.4, torso=0.7, hip_width=0.3, hip_back=0.1)
    floor = m.FloorCalibration(values=m.FloorValues(height=0.25))
    outs = feed(
        core,
        [
            message("calibration", 0, m.BodyCalibration(values=values)),
            message("calibration", 0, floor),
            imu(0),
            head(0, p=(0.0, 1.9, 0.0)),
            imu(10 * MS),
        ],
    )
    assert outs[0].data.left.ankle.p[1] == pytest.approx(0.34)
    leg = outs[-1].data.left
    assert math.dist(leg.hip, leg.knee) == pytest.approx(0.5)


def test_a_heading_turns_a_foot_that_no_camera_has_seen_on_its_spot():
    core = FusionCore(Settings())
    values = m.HeadingValues(yaw=0.0, imu_yaw=m.PerSideYaw(left=1.0))
    feed(core, [imu(t * 10 * MS) for t in range(20)])
    heading = message("calibration", 200 * MS, m.HeadingCalibration(values=values))
    outs = feed(core, [heading, imu(200 * MS), imu(210 * MS), heading, imu(220 * MS)])
    for out in (out for out in outs if out.stream == "pose/body"):
        assert float(rot.yaw_of(out.data.left.ankle.q)) == pytest.approx(1.0, abs=1e-3)
        assert math.dist(out.data.left.ankle.p, (-0.1, 0.09, 0.0)) < 1e-3


def test_a_calibration_that_comes_again_changes_nothing():
    """It comes every 5 s, and a filter that is placed anew has to find its foot again."""
    place = m.ImuValues(side="left", acc_bias=(0, 0, 0), gyro_bias=(0, 0, 0), p=(0, 0.02, 0), q=IDENTITY)
    placed = m.ImuCalibration(values=place)
    results = []
    for repeats in (0, 3):
        core = FusionCore(Settings())
        outs = feed(core, [message("calibration", 0, placed), head(0), imu(0)])
        for k in range(1, 120):
            t = k * 10 * MS
            outs += feed(core, [head(t), imu(t), marker(t, (-0.1, -1.55, -0.15), q=TAG_ON_INSTEP)])
            if repeats and k % 30 == 0:
                outs += feed(core, [message("calibration", t, placed)])
        results.append([out for out in outs if out.stream == "pose/body"])
    assert results[0][-1].data.left.stage == "marker"
    assert results[0][-1].data == results[1][-1].data


@pytest.mark.parametrize("solver", ["two-bone", "fabrik"])
def test_bones_of_what_is_published_have_their_lengths(solver):
    core = FusionCore(Settings(body={"solver": solver}, fusion=FusionSettings(filter="reference")))
    body = None
    for k in range(1, 60):
        t = k * 10 * MS
        p = (-0.1, -1.5 + 0.3 * abs(math.sin(0.1 * k)), -0.2 * math.sin(0.1 * k))
        for out in feed(core, [head(t), imu(t), marker(t, p), marker(t, (0.1, -1.5, -0.1), side="right")]):
            body = out.data if out.stream == "pose/body" else body
    skeleton = core._body.skeleton
    for leg in (body.left, body.right):
        assert math.dist(leg.hip, leg.knee) == pytest.approx(skeleton.thigh, abs=1e-6)
        assert math.dist(leg.knee, leg.ankle.p) == pytest.approx(skeleton.shank, abs=1e-6)


def test_a_mount_correction_counts_only_for_the_mount_it_was_found_for():
    config = AT_ONCE
    for base, shift in (("another", 0.0), (config.camera.mount_hash, 0.1)):
        core = FusionCore(config)
        values = m.MountValues(p=(0.1, 0, 0), q=IDENTITY, sigma_p=1e-3, sigma_q=1e-3, base=base)
        out = feed(
            core,
            [
                message("calibration", 0, m.MountCalibration(values=values)),
                head(0),
                marker(0, (0.0, -1.5, 0.0)),
                imu(10 * MS),
            ],
        )[-1]
        assert out.data.left.ankle.p[0] == pytest.approx(shift, abs=1e-3)


finite = st.floats(-1e4, 1e4)
stamps = st.integers(-(10**10), 10**10)
events = st.one_of(
    st.builds(
        lambda t, a, s: imu(t, s, a), stamps, st.tuples(finite, finite, finite), st.sampled_from(["left", "right"])
    ),
    st.builds(lambda t, p, s: marker(t, p, s, IDENTITY), stamps, st.tuples(finite, finite, finite), st.just("left")),
    st.builds(lambda t, p, o: head(t, p, origin=o), stamps, st.tuples(finite, finite, finite), st.integers(0, 2)),
    st.builds(lambda t: head(t, tracked=False), stamps),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(events, st.integers(0, 10**8)), max_size=40))
def test_whatever_comes_only_valid_messages_leave(sequence):
    core = FusionCore(Settings())
    now, arrivals = 0, []
    for each, step in sequence:
        now += step
        arrivals.append((now, each))
    for out in fuse(arrivals, core):
        assert decode(encode(out)) == out


def test_the_same_messages_give_the_same_bytes():
    rng = np.random.default_rng(3)
    sequence = []
    for k in range(300):
        t = k * 5 * MS
        sequence.append((t, head(t)))
        sequence.append((t, imu(t, acc=tuple(rng.normal(0, 3, 3) + [0, G, 0]))))
        sequence.append((t, marker(t - 30 * MS, tuple(rng.normal(0, 0.01, 3) + [0, -1.5, 0]), q=IDENTITY)))
    first, second = ([encode(out) for out in fuse(sequence, FusionCore(Settings()))] for _ in range(2))
    assert len(first) > 250
    assert first == second


def test_targets_and_gait_come_with_every_pose_and_events_when_they_happen():
    core, outs = FusionCore(Settings()), []
    for t in range(0, 2000, 5):
        # The toes go down and up again while the ankle is thrown up: one step in place, seen by one IMU.
        share = min(max((t - 1000) / 400, 0.0), 1.0)
        lift = 0.1 * (2 * math.pi / 0.4) ** 2 / 2 * math.cos(2 * math.pi * share) if 0.0 < share < 1.0 else 0.0
        outs += core.handle(imu(t * MS, acc=(0.0, G + lift, 0.0)), t * MS)
    by_stream = {
        stream: [o for o in outs if o.stream == stream]
        for stream in ("pose/body", "pose/ik", "gait/state", "gait/event")
    }
    assert len(by_stream["pose/body"]) == len(by_stream["pose/ik"]) == len(by_stream["gait/state"]) == 400
    assert by_stream["gait/state"][-1].data.right is None
    events = by_stream["gait/event"]
    assert [o.data.event for o in events if o.data.side] == [
        "heel_off",
        "toe_off",
        "mid_swing",
        "terminal_swing",
        "foot_strike",
    ]
    assert all(o.t <= o.t_pub for o in events)
    assert [o.seq for o in events] == list(range(len(events)))
    apex = next(o for o in events if o.data.event == "mid_swing")
    assert apex.t == pytest.approx(1200 * MS, abs=20 * MS)
