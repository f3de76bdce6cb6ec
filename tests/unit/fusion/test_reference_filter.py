"""The reference filter against the thesis's matrices, written out here by hand, and against a plain 9-state filter."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings, Placement
from foottrack_service.fusion import reference as ref
from foottrack_service.fusion.interface import HeadSample, ImuSample, OpticalFix, Verdict
from foottrack_service.fusion.reference import Kinematics, ReferenceFilter, ReferenceOptions

BARE = FootSettings(marker=Placement())
UPRIGHT = rot.IDENTITY
MS = 1_000_000


def imu(t, acceleration=(0.0, 0.0, 0.0), q=UPRIGHT):
    return ImuSample(t, np.array(acceleration) + np.array([0.0, STANDARD_GRAVITY, 0.0]), None, np.array(q))


def fix(t, p, kind="marker", q=None, head_p=(0.0, 0.0, 0.0), newest_p=None):
    head = HeadSample(t, np.array(head_p), UPRIGHT)
    newest = head if newest_p is None else HeadSample(t, np.array(newest_p), UPRIGHT)
    return OpticalFix(t, kind, np.array(p), q, None, np.eye(3) * 1e-4, None, 50.0, head, newest)


def started(options=None, foot=BARE):
    """A filter that has seen one standing sample at t = 0, on the left."""
    made = ReferenceFilter(foot, "left", options)
    made.on_imu(imu(0))
    return made


def transition(dt):
    return np.array([[1, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])


@pytest.mark.parametrize("noise", ["additive", "through_transition"])
@pytest.mark.parametrize("jacobian", ["stationary", "moving"])
@pytest.mark.parametrize("stands", [False, True])
def test_one_step_is_the_matrices_of_the_thesis(noise, jacobian, stands):
    made = Kinematics(ReferenceOptions(jacobian, noise), [0.3, 0.2, 0.1])
    made.correct(ref.ACCELERATION, [3.0, 2.0, 1.0], 0.35)
    made.step(0.07, False)
    made.correct(ref.POSITION, [0.5, 0.4, 0.3], 0.35)
    state, covariance = made.state, made.covariance
    made.step(0.1, stands)
    process = np.diag([1.0, 0, 0]) if stands else transition(0.1)
    a = transition(0.1) if stands and jacobian == "moving" else process
    q = np.diag(ref.PROCESS_NOISE)
    assert np.allclose(made.state, process @ state)
    expected = a @ covariance @ a.T + (q if noise == "additive" else a @ q @ a.T)
    assert np.allclose(made.covariance, expected)


def test_noise_matrices_are_the_thesis_s_sigmas_used_as_variances():
    assert ref.PROCESS_NOISE == (2e-4, 6e-5, 0.02)
    assert ref.INITIAL_VARIANCE == (1.0, 0.5625, 225.0)
    assert (ref.MARKER_NOISE, ref.DEPTH_NOISE, ref.ACCELERATION_NOISE) == (1.5e-4, 0.35, 0.35)


def test_agrees_with_a_plain_filter_of_nine_states():
    """Predict and correct with markers and accelerations at uneven steps, beside filterpy's KalmanFilter."""
    rng = np.random.default_rng(5)
    ours = ReferenceFilter(BARE, "left")
    plain = KalmanFilter(dim_x=9, dim_z=3)
    eye = np.eye(3)
    plain.Q = np.kron(np.diag(ref.PROCESS_NOISE), eye)
    t = 0
    first = np.array([0.1, 0.2, 0.3])
    ours.on_fix(fix(t, first), t)
    plain.x = np.concatenate([first, np.zeros(6)])[:, None]
    plain.P = np.kron(np.diag(ref.INITIAL_VARIANCE), eye)
    plain.update(first[:, None], R=ref.MARKER_NOISE * eye, H=np.kron([1.0, 0.0, 0.0], eye))
    for _ in range(60):
        dt = int(rng.integers(1, 30)) * MS
        t += dt
        measured = rng.normal(size=3) * 3.0 + 1.0
        plain.predict(F=np.kron(transition(dt * 1e-9), eye))
        if rng.random() < 0.3:
            ours.on_fix(fix(t, measured), t)
            row, noise = [1.0, 0.0, 0.0], ref.MARKER_NOISE
        else:
            ours.on_imu(imu(t, measured))
            row, noise = [0.0, 0.0, 1.0], ref.ACCELERATION_NOISE
        plain.update(measured[:, None], R=noise * eye, H=np.kron(row, eye))
    assert np.allclose(ours._kinematics.state.ravel(), plain.x[:, 0], atol=1e-9)
    assert np.allclose(np.kron(ours._kinematics.covariance, eye), plain.P, atol=1e-9)


def test_a_standing_foot_keeps_its_place_and_loses_its_motion():
    made = started()
    made.on_imu(imu(10 * MS, (3.0, 0.0, 0.0)))
    assert made._kinematics.state[1, 0] > 0.0
    place = made._kinematics.state[0] + made._kinematics.state[1] * 0.0
    made.on_imu(imu(20 * MS, (0.49, 0.0, 0.0)))
    assert np.array_equal(made._kinematics.state[0], place)
    assert np.array_equal(made._kinematics.state[1:], np.zeros((2, 3)))
    assert made.estimate(20 * MS).contact


def test_half_a_metre_per_second_squared_is_not_standing():
    made = started()
    made.on_imu(imu(10 * MS, (0.5, 0.0, 0.0)))
    assert not made.estimate(10 * MS).contact
    # Q of the acceleration was added at the standing sample and at this one.
    assert made._kinematics.state[2, 0] == pytest.approx(0.5 * 0.04 / (0.04 + 0.35), rel=1e-6)


def test_stationary_process_s_jacobian_cuts_the_cross_terms():
    made = started()
    assert np.allclose(made._kinematics.covariance, np.diag([1.0 + 2e-4, 6e-5, 0.02]))


def test_taken_literally_the_first_acceleration_after_a_stop_throws_the_foot():
    jumps = {}
    for reading in ("stationary", "moving"):
        made = started(ReferenceOptions(stationary_jacobian=reading))
        for k in range(1, 51):
            made.on_imu(imu(k * 10 * MS))
        before = made._kinematics.state[0].copy()
        made.on_imu(imu(510 * MS, (3.0, 0.0, 0.0)))
        jumps[reading] = np.linalg.norm(made._kinematics.state[0] - before)
    assert jumps["moving"] > 0.3 > 0.01 > jumps["stationary"]


def test_read_out_predicts_and_averages_at_90_hz():
    made = started()
    first = made.estimate(0).p
    assert np.allclose(first, [-0.1, 0.09, 0.0])
    made._kinematics.p = [0.9, 0.09, 0.0]
    period = round(1e9 / 90)
    assert np.allclose(made.estimate(period - 1).p, first)
    assert np.allclose(made.estimate(period).p, first + 0.2 * np.array([1.0, 0, 0]))
    assert np.allclose(made.estimate(2 * period).p, first + 0.36 * np.array([1.0, 0, 0]))


def test_every_read_adds_process_noise_whatever_its_length():
    made = started()
    made.estimate(0)
    assert np.allclose(made._kinematics.covariance[0, 0], 1.0 + 2 * 2e-4)


def test_outputs_at_100_hz_are_read_90_times_a_second():
    made = started()
    reads = 0
    for k in range(1, 101):
        before = made._kinematics.variance
        made.estimate(k * 10 * MS)
        reads += made._kinematics.variance != before
    assert reads in (89, 90, 91)


def test_uses_the_newest_head_pose_and_not_the_picture_s():
    made = ReferenceFilter(BARE, "left")
    made.on_fix(fix(0, (0.0, -1.5, 0.0), head_p=(0.0, 1.6, 0.0), newest_p=(0.2, 1.6, 0.0)), 30 * MS)
    assert np.allclose(made._kinematics.state[0], [0.2, 0.1, 0.0])


def test_depth_only_while_the_tag_is_lost():
    made = started()
    assert made.on_fix(fix(0, (0, 0, 0)), 30 * MS) is Verdict.ACCEPTED
    assert made.on_fix(fix(10 * MS, (5, 5, 5), kind="depth"), 40 * MS) is Verdict.UNUSED
    assert made.on_fix(fix(200 * MS, (5, 5, 5), kind="depth"), 230 * MS) is Verdict.ACCEPTED


def test_a_foot_with_an_imu_alone_starts_on_the_floor_beside_the_origin_with_its_toes_ahead():
    turned = rot.from_yaw(1.2)
    for side, x in (("left", -0.1), ("right", 0.1)):
        made = ReferenceFilter(FootSettings(), side)
        made.on_imu(imu(0, q=turned))
        found = made.estimate(0)
        assert np.allclose(found.p, [x, 0.09, 0.0])
        assert np.allclose(rot.rotate(found.q, [0, 0, -1]), [0, 0, -1])
        assert found.stage == "lost"  # nobody has seen it: its sigma is that of P0


def test_the_first_tag_fixes_the_yaw_and_gravity_chooses_between_its_solutions():
    foot = FootSettings()
    made = ReferenceFilter(foot, "left")
    made.on_imu(imu(0, q=rot.from_yaw(1.2)))
    tag = rot.multiply(rot.from_yaw(-0.4), foot.marker.q)
    flipped = rot.multiply(rot.from_axis_angle([1.0, 0.0, 0.0], 0.6), rot.multiply(rot.from_yaw(0.5), foot.marker.q))
    seen = fix(0, (0, 0, 0))
    seen = OpticalFix(0, "marker", seen.p, flipped, tag, seen.cov, None, 50.0, seen.head, seen.head_at_arrival)
    made.on_fix(seen, 0)
    made.on_imu(imu(10 * MS, q=rot.from_yaw(1.2 + 0.1)))
    assert rot.yaw_of(made.estimate(10 * MS).q) == pytest.approx(-0.3)


def test_raw_axes_go_through_an_ahrs():
    made = ReferenceFilter(FootSettings(), "left")
    tilt = rot.from_axis_angle([1.0, 0.0, 0.0], 0.5)
    felt = rot.unrotate(tilt, [0.0, STANDARD_GRAVITY, 0.0])
    for k in range(800):
        made.on_imu(ImuSample(k * 10 * MS, felt, np.zeros(3), None))
    found = made.estimate(8000 * MS)
    assert np.allclose(rot.unrotate(found.q, [0, 1, 0]), felt / STANDARD_GRAVITY, atol=1e-3)


def test_a_known_recentring_carries_everything_along():
    foot = FootSettings()
    made = ReferenceFilter(foot, "right")
    made.on_imu(imu(0))
    made.on_fix(fix(0, (0.3, 0.1, -0.4), q=np.array(foot.marker.q)), 0)
    before = made.estimate(0)
    p, q = np.array([1.0, 0.0, 2.0]), rot.from_yaw(0.7)
    made.on_recentred(p, q)
    after = made.estimate(0)
    assert np.allclose(after.p, p + rot.rotate(q, before.p))
    assert rot.angle_between(after.q, rot.multiply(q, before.q)) < 1e-9


def test_stages_fall_as_the_sources_fall_silent():
    made = started()
    for k in range(20):
        made.on_imu(imu(k * 10 * MS))
        made.on_fix(fix(k * 10 * MS, (0, 0, 0)), k * 10 * MS)
    last = 190 * MS
    assert made.estimate(last).stage == "marker"
    assert made.estimate(last).age == pytest.approx(0.0)
    for k in range(20, 40):
        made.on_imu(imu(k * 10 * MS))
    assert made.estimate(390 * MS).stage == "inertial"
    assert made.estimate(600 * MS).stage == "coasting"
    assert made.estimate(1100 * MS).stage == "lost"
