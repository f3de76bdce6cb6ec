"""The simulated IMU feels what physics says, and errs as its data sheet says."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations
from foottrack_service.config import Placement, Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation import imu, noise
from foottrack_service.simulation.imu import BNO08X, FUSED, RAW
from foottrack_service.simulation.tasks import TASKS
from foottrack_service.simulation.truth import Track, grid

ON_ANKLE = Placement()
MOUNTED = Placement(p=(0.03, -0.02, -0.11), q=(0.1825742, 0.3651484, 0.5477226, 0.7302967))


def still(q: Array = rotations.IDENTITY, seconds: float = 30.0) -> Track:
    t = grid(seconds)
    return Track(t, np.tile([0.1, 0.09, 0.2], (len(t), 1)), np.tile(q, (len(t), 1)))


def random(seed: int = 5) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_at_rest_it_feels_one_g_upwards() -> None:
    force, rate, q = imu.felt(still(), ON_ANKLE, np.array([1.0, 2.0]))
    np.testing.assert_allclose(force, np.tile([0.0, 9.80665, 0.0], (2, 1)), atol=1e-9)
    np.testing.assert_allclose(rate, 0.0, atol=1e-9)
    np.testing.assert_allclose(q, np.tile(rotations.IDENTITY, (2, 1)), atol=1e-12)


def test_the_mounting_turns_what_it_feels() -> None:
    quarter = Placement(q=(0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))  # the sensor's x is the foot's y
    force, _, _ = imu.felt(still(), quarter, np.array([1.0]))
    np.testing.assert_allclose(force, [[STANDARD_GRAVITY, 0.0, 0.0]], atol=1e-9)


def test_a_lever_arm_feels_the_turn() -> None:
    t = grid(4.0)
    spin = Track(t, np.zeros((len(t), 3)), rotations.from_yaw(2.0 * t))
    force, rate, _ = imu.felt(spin, Placement(p=(0.0, 0.0, -0.5)), np.array([1.0]))
    # Centripetal: towards the axis, that is +z of the body, 2^2 x 0.5.
    np.testing.assert_allclose(force, [[0.0, STANDARD_GRAVITY, 2.0]], atol=1e-6)
    np.testing.assert_allclose(rate, [[0.0, 2.0, 0.0]], atol=1e-9)


@pytest.mark.parametrize("task", ["walk", "circle", "tracker-moving"])
@pytest.mark.parametrize("place", [ON_ANKLE, MOUNTED])
def test_integrating_twice_gives_the_truth_back(task: str, place: Placement) -> None:
    foot = TASKS[task].truth(8.0, Settings(), "hard", random()).left
    hz = 2000.0
    t = np.arange(0.0, 8.0, 1.0 / hz)
    force, rate, attitude = imu.felt(foot, place, t)
    q = [attitude[0]]
    for step in rotations.from_rotation_vector(0.5 * (rate[1:] + rate[:-1]) / hz):
        q.append(rotations.multiply(q[-1], step))
    assert rotations.angle_between(np.array(q), attitude).max() < 1e-4
    a = rotations.rotate(attitude, force) - [0.0, STANDARD_GRAVITY, 0.0]
    start = foot.kinematics(t[:1])
    arm = rotations.rotate(start.q, place.p)
    v0 = start.v + rotations.rotate(start.q, np.cross(start.w, place.p))
    v = v0 + np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (a[1:] + a[:-1]) / hz, axis=0)])
    p = start.p + arm + np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (v[1:] + v[:-1]) / hz, axis=0)])
    assert np.abs(p - foot.point(t, place.p)).max() < 2e-3


@pytest.mark.parametrize("hz", [100.0, 400.0])
@pytest.mark.parametrize("kind", ["fused", "raw"])
def test_noise_has_the_stated_density(hz: float, kind: str) -> None:
    model = FUSED if kind == "fused" else RAW
    samples = imu.measured(still(seconds=60.0), ON_ANKLE, 60.0, hz, kind, 0.0, random())  # type: ignore[arg-type]
    for values, density, step in (
        (samples.acc, model.acc_density, model.acc_step),
        (samples.gyro, model.gyro_density, model.gyro_step),
    ):
        if values is None:
            assert kind == "fused"
            continue
        # Differences of neighbours do not see the bias; quantisation adds step^2 / 12.
        sd = np.diff(values, axis=0).std(axis=0) / np.sqrt(2.0)
        expected = np.hypot(density * np.sqrt(hz / 2.0), step / np.sqrt(12.0))
        np.testing.assert_allclose(sd, expected, rtol=0.06)


def test_biases_vary_from_device_to_device_as_stated() -> None:
    acc, gyro = [], []
    for seed in range(40):
        samples = imu.measured(still(seconds=4.0), ON_ANKLE, 4.0, 100.0, "raw", 0.0, random(seed))
        assert samples.gyro is not None
        acc.append(samples.acc.mean(axis=0) - [0.0, STANDARD_GRAVITY, 0.0])
        gyro.append(samples.gyro.mean(axis=0))
    assert np.std(acc) == pytest.approx(RAW.acc_bias_sd, rel=0.2)
    assert np.std(gyro) == pytest.approx(RAW.gyro_bias_sd, rel=0.2)


def test_a_fused_device_knows_up_but_not_north() -> None:
    tilts, yaws = [], []
    for seed in range(40):
        samples = imu.measured(still(seconds=4.0), MOUNTED, 4.0, 100.0, "fused", 0.0, random(seed))
        assert samples.q is not None
        assert np.abs(np.linalg.norm(samples.q, axis=-1) - 1.0).max() < 1e-12
        error = rotations.multiply(samples.q, rotations.conjugate(rotations.normalised(MOUNTED.q)))
        up = rotations.rotate(error, [0.0, 1.0, 0.0])
        tilts.append(np.degrees(np.arccos(np.clip(up[:, 1], -1.0, 1.0))).mean())
        yaws.append(rotations.yaw_of(error)[0])
        # The data sheet's linear acceleration at rest is good although the accelerometer has a bias.
        linear = rotations.rotate(samples.q, samples.acc) - [0.0, STANDARD_GRAVITY, 0.0]
        assert np.linalg.norm(linear[:, [0, 2]].mean(axis=0)) < 0.45
    assert np.sqrt(np.mean(np.square(tilts))) == pytest.approx(1.5, rel=0.25)
    assert np.ptp(yaws) > 4.0


def test_a_fused_device_turns_as_the_foot_does() -> None:
    foot = TASKS["steps"].truth(10.0, Settings(), "mild", random()).left
    samples = imu.measured(foot, ON_ANKLE, 10.0, 100.0, "fused", 0.0, random())
    assert samples.q is not None
    truth = foot.pose(samples.t)[1]
    error = rotations.multiply(samples.q, rotations.conjugate(truth))
    from_start = rotations.angle_between(error[0], error)
    assert np.degrees(from_start).max() < 12.0
    assert np.degrees(from_start).mean() < 3.5


def test_a_bno08x_over_shtp_has_the_attitude_and_a_gyro_of_nearly_the_right_scale() -> None:
    t = grid(20.0)
    spin = Track(t, np.zeros((len(t), 3)), rotations.from_yaw(2.0 * t))
    scales = []
    for seed in range(30):
        samples = imu.measured(spin, ON_ANKLE, 20.0, 100.0, "bno08x", 0.0, random(seed))
        assert samples.q is not None
        assert samples.gyro is not None
        scales.append(samples.gyro[:, 1].mean() / 2.0)
    expected = np.hypot(BNO08X.gyro_scale_sd, BNO08X.gyro_bias_sd / 2.0)
    assert np.std(scales) == pytest.approx(expected, rel=0.35)


@pytest.mark.parametrize("kind", ["fused", "raw"])
def test_it_clips_at_eight_g(kind: str) -> None:
    foot = TASKS["walk"].truth(12.0, Settings(), "hard", random()).left
    samples = imu.measured(foot, ON_ANKLE, 12.0, 400.0, kind, 0.0, random())  # type: ignore[arg-type]
    limit = 8.0 * STANDARD_GRAVITY
    assert np.abs(samples.acc).max() <= limit + 0.01
    assert np.abs(samples.acc).max() > 0.9 * limit


def test_stamps_are_when_it_was_and_arrivals_follow() -> None:
    samples = imu.measured(still(), ON_ANKLE, 30.0, 100.0, "raw", 0.0, random())
    assert 0.99 < len(samples.t) / 3000 < 1.0, "a few are lost on the way"
    assert np.all(np.diff(samples.t_arr) >= 0.0)
    assert np.all(samples.t_arr > samples.t)
    clock = np.polyfit(samples.t_dev * 1e-6, samples.t, 1)
    assert abs(clock[0] - 1.0) < 150e-6
    residual = samples.t - np.polyval(clock, samples.t_dev * 1e-6)
    assert 0.05e-3 < residual.std() < 0.3e-3
    late = imu.measured(still(), ON_ANKLE, 30.0, 100.0, "raw", 0.02, random())
    np.testing.assert_allclose(late.t - samples.t, 0.02, atol=1e-9)
    np.testing.assert_array_equal(late.t_arr, samples.t_arr)


def test_random_processes_have_the_stated_spread() -> None:
    walk = noise.gauss_markov(random(), 200_000, 0.01, 1.0, np.array([1.0, 2.0, 0.5]))
    np.testing.assert_allclose(walk.std(axis=0), [1.0, 2.0, 0.5], rtol=0.06)
    lag = np.sum(walk[:-100] * walk[100:], axis=0) / np.sum(walk**2, axis=0)
    np.testing.assert_allclose(lag, np.exp(-1.0), atol=0.06)
    slow = noise.smooth_gauss_markov(random(), 400_000, 0.01, 2.0, 0.1, 1.4)
    assert slow.std() == pytest.approx(1.4, rel=0.05)
    for steps, tau_s in ((1, 0.01), (30, 0.3)):
        # Correlation of two first-order low-passes in a row: (2 e^(-t/2) - 0.1 e^(-t/0.1)) / 1.9.
        kept = (2.0 * np.exp(-tau_s / 2.0) - 0.1 * np.exp(-tau_s / 0.1)) / 1.9
        changed = np.sqrt(np.mean((slow[steps:] - slow[:-steps]) ** 2))
        assert changed == pytest.approx(1.4 * np.sqrt(2.0 - 2.0 * kept), rel=0.08)
    smooth = noise.wander(random(), 100_000, 100.0, 1.0, 0.3)
    np.testing.assert_allclose(smooth.std(axis=0), 0.3, rtol=0.1)
    spectrum = np.abs(np.fft.rfft(smooth[:, 0])) ** 2
    assert spectrum[np.fft.rfftfreq(len(smooth), 0.01) > 2.0].sum() < 1e-3 * spectrum.sum()
