"""What the simulated camera sees, and how wrong it is about it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.config import Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation import camera, optical
from foottrack_service.simulation.anatomy import sole
from foottrack_service.simulation.camera import Eye
from foottrack_service.simulation.faults import Fault, MountSlipped
from foottrack_service.simulation.optical import OpticalSamples
from foottrack_service.simulation.tasks import TASKS
from foottrack_service.simulation.truth import BOTH, FootTrack, Track, Truth, grid

SETTINGS = Settings()


@cache
def made(task: str, seconds: float = 16.0) -> Truth:
    return TASKS[task].truth(seconds, SETTINGS, "mild", np.random.default_rng(2))


def seen(truth: Truth, side: Side = "left", seed: int = 4, faults: Sequence[Fault] = ()) -> OpticalSamples:
    run = optical.pictures(truth.seconds, np.random.default_rng(seed))
    samples = optical.markers(truth, side, SETTINGS, run, faults, np.random.default_rng(seed + 1))
    return samples.kept(samples.found)


def target_in_head(truth: Truth, side: Side, t: Array) -> Array:
    head_p, head_q = truth.head.pose(t)
    return rotations.unrotate(head_q, truth.feet[side].point(t, SETTINGS.feet.of(side).marker.p) - head_p)


def eye_at(p: tuple[float, float, float], q: tuple[float, float, float, float]) -> Eye:
    return Eye(np.zeros(1), np.array([p]), np.array([q]))


def test_projection_by_hand() -> None:
    ahead = eye_at((0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    pixels, depth = camera.project(ahead, np.array([[0.5, 1.5, -2.0]]))
    np.testing.assert_allclose(pixels, [[424.0 + 612.0 * 0.25, 240.0 - 612.0 * 0.25]])
    np.testing.assert_allclose(depth, [2.0])
    down = eye_at((0.0, 1.5, 0.0), (-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)))
    pixels, depth = camera.project(down, np.array([[0.0, 0.0, -0.15]]))
    np.testing.assert_allclose(depth, [1.5])
    np.testing.assert_allclose(pixels, [[424.0, 240.0 - 61.2]], atol=1e-9)


def test_tags_are_found_only_where_the_whole_tag_is_in_the_picture() -> None:
    truth = made("steps", 30.0)
    samples = seen(truth)
    honest = ~samples.false
    eye = camera.eye(truth, samples.t, SETTINGS.camera.mount, ())
    pixels, _ = camera.project(eye, truth.left.point(samples.t, SETTINGS.feet.left.marker.p))
    inside = np.all((pixels > 4.0) & (pixels < [camera.WIDTH - 4.0, camera.HEIGHT - 4.0]), axis=-1)
    assert inside[honest].all()
    assert samples.edge_px[honest].min() > 0.0
    t = np.arange(0.0, 30.0, 1.0 / 60.0)
    view = camera.tag_views(truth, "left", SETTINGS, camera.eye(truth, t, SETTINGS.camera.mount, ()), ())[0]
    assert 0.02 < (~view.inside).mean() < 0.4, "steps leave the picture now and then"
    assert 22.0 < np.median(view.size_px[view.inside]) < 34.0, "6 cm at 1.3 to 1.5 m"


@pytest.mark.parametrize("task", ["walk", "knee-bends", "steps"])
def test_legs_hide_tags_at_times(task: str) -> None:
    truth = made(task)
    t = np.arange(0.0, 16.0, 1.0 / 60.0)
    eye = camera.eye(truth, t, SETTINGS.camera.mount, ())
    hidden = camera.hidden(truth, truth.left.point(t, SETTINGS.feet.left.marker.p), eye, SETTINGS)
    assert 0.05 < hidden.mean() < 0.8


def test_nobody_stands_in_the_way_on_the_bench() -> None:
    assert seen(made("still")).found.sum() > 0.97 * 16 * 60


def test_clearance_of_a_limb_by_hand() -> None:
    def between(*ends: tuple[float, float, float]) -> float:
        a, b, c, d = (np.array([end], dtype=np.float64) for end in ends)
        return float(camera._clearance(a, b, c, d, (0.1, 0.3))[0])

    assert between((0, 0, 0), (2, 0, 0), (1, 1, -1), (1, 1, 1)) == pytest.approx(1.0 - 0.2)
    assert between((0, 0, 0), (1, 0, 0), (4, 4, 0), (4, 5, 0)) == pytest.approx(5.0 - 0.1)
    assert between((0, 0, 0), (1, 0, 0), (-3, 0, 2), (0, 0, 2)) == pytest.approx(2.0 - 0.3)
    assert between((0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)) == pytest.approx(-0.2)


@pytest.mark.parametrize("task", ["still", "head-bench", "tracker-moving"])
@pytest.mark.parametrize("side", BOTH)
def test_errors_are_what_the_covariance_says_beside_a_small_bias(task: str, side: Side) -> None:
    truth = made(task)
    samples = seen(truth, side)
    honest = ~samples.false
    error = (samples.p - target_in_head(truth, side, samples.t))[honest]
    cov = samples.cov[honest][:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    noise = error - error.mean(axis=0) if task == "still" else np.diff(error, axis=0) / np.sqrt(2.0)
    square = np.einsum("ni,nij,nj->n", noise, np.linalg.inv(cov[: len(noise)]), noise)
    # The stamp's own jitter is not in it, nor is the bias; motion adds a little of both.
    assert np.median(square) == pytest.approx(2.37, rel=0.25), "the median of chi-square with 3 degrees"
    assert np.linalg.norm(error.mean(axis=0)) < 0.015


def test_depth_noise_grows_with_the_square_of_the_range() -> None:
    def sd(height: float) -> float:
        t = grid(20.0)
        down = rotations.from_axis_angle([1.0, 0.0, 0.0], np.radians(-70.0))  # the camera straight down
        head = Track(t, np.tile([0.0, height, 0.0], (len(t), 1)), np.tile(down, (len(t), 1)))
        base = sole(SETTINGS.feet.left)
        still = np.ones(len(t), dtype=np.bool_)
        foot = FootTrack(
            t,
            np.tile([0.0, 0.09, 0.1], (len(t), 1)),
            np.tile(rotations.IDENTITY, (len(t), 1)),
            heel=still,
            toe=still,
            heel_point=base.heel,
            ball_point=base.ball,
        )
        samples = seen(Truth(20.0, head, {"left": foot, "right": foot}))
        mount_q = rotations.normalised(SETTINGS.camera.mount.q)
        return float(rotations.unrotate(mount_q, samples.p[~samples.false])[:, 2].std())

    near, far = sd(1.1), sd(2.1)
    depth = np.array([1.1, 2.1]) - 0.05 - 0.08 * np.sin(np.radians(70.0))
    expected = depth**2 * 0.08 / (612.0 * 0.05) / 2.0
    np.testing.assert_allclose([near, far], expected, rtol=0.1)


def test_single_tags_flip_as_often_as_stated_and_the_other_solution_is_right() -> None:
    truth = made("tracker-moving", 40.0)
    samples = seen(truth)
    samples = samples.kept(~samples.false)
    assert samples.q is not None
    assert samples.q_alt is not None
    head_q = truth.head.pose(samples.t)[1]
    tag = rotations.multiply(truth.left.pose(samples.t)[1], rotations.normalised(SETTINGS.feet.left.marker.q))
    right = rotations.multiply(rotations.conjugate(head_q), tag)
    first, second = rotations.angle_between(right, samples.q), rotations.angle_between(right, samples.q_alt)
    differ = rotations.angle_between(samples.q, samples.q_alt) > np.radians(20.0)
    assert differ.mean() > 0.4
    assert 0.08 < (second < first)[differ].mean() < 0.16
    assert np.degrees(np.median(np.minimum(first, second))) < 6.0


def test_blurred_tags_are_missed() -> None:
    def found(blur_px: float, size_px: float) -> float:
        n = 4000
        view = camera.TagView(
            np.full((n, 4, 2), 100.0),
            np.ones(n),
            np.full(n, size_px),
            np.ones(n, dtype=np.bool_),
            np.zeros(n, dtype=np.bool_),
            np.full(n, blur_px),
        )
        return float(optical._found(view, 6, np.random.default_rng(1)).mean())

    # Measured on rendered pictures at 1.5 m and 8 px of blur: a 6 cm tag 2 to 16 %, a 10 cm tag 85 %.
    assert 0.02 < found(8.0, 24.0) < 0.16
    assert found(8.0, 40.0) == pytest.approx(0.85, abs=0.05)
    assert found(0.0, 24.0) > 0.97
    assert found(0.0, 8.0) < 0.02


def test_tags_at_the_picture_s_border_are_missed_as_the_detector_misses_them() -> None:
    n = 100
    corners = np.full((n, 4, 2), 100.0)
    corners[n // 2 :, 0, 0] = 2.9
    none = np.zeros(n, dtype=np.bool_)
    view = camera.TagView(corners, np.ones(n), np.full(n, 40.0), ~none, none, np.zeros(n))
    found = optical._found(view, 6, np.random.default_rng(1))
    assert found[: n // 2].mean() > 0.9
    assert not found[n // 2 :].any()


def test_a_rolling_shutter_sees_each_row_at_its_own_time() -> None:
    truth = made("head-moving")
    middle = np.arange(60, 600) / 60.0
    point = np.asarray(SETTINGS.feet.left.marker.p)
    t = camera.row_times(truth, middle, ("left", point), SETTINGS.camera.mount, ())
    rows = camera.project(camera.eye(truth, t, SETTINGS.camera.mount, ()), truth.left.point(t, point))[0][:, 1]
    inside = (rows > 0.0) & (rows < camera.HEIGHT)
    expected = (rows / camera.HEIGHT - 0.5) * camera.READOUT_S
    np.testing.assert_allclose((t - middle)[inside], expected[inside], atol=2e-5)
    assert inside.mean() > 0.5


def test_a_slipped_mount_shows_as_a_turn_of_all_finds() -> None:
    truth = made("still")
    turn = (0.0, np.radians(2.0), 0.0)
    straight, slipped = seen(truth), seen(truth, faults=[MountSlipped(start=8.0, turn=turn, shift=(0.0, 0.01, 0.0))])
    before, after = straight.p[straight.t < 8.0].mean(axis=0), straight.p[straight.t > 8.0].mean(axis=0)
    np.testing.assert_allclose(before, after, atol=1e-3)
    mount, mount_q = np.asarray(SETTINGS.camera.mount.p), rotations.normalised(SETTINGS.camera.mount.q)
    honest = (slipped.t > 8.0) & ~slipped.false
    moved = slipped.p[honest].mean(axis=0)
    truly_from_eye = target_in_head(truth, "left", np.array([9.0]))[0] - mount - [0.0, 0.01, 0.0]
    local = rotations.unrotate(rotations.multiply(mount_q, rotations.from_rotation_vector(turn)), truly_from_eye)
    np.testing.assert_allclose(moved, mount + rotations.rotate(mount_q, local), atol=0.012)
    assert np.linalg.norm(moved - before) > 0.03


def test_a_blob_is_off_towards_the_ankle_and_noisier() -> None:
    truth = made("head-bench")
    run = optical.pictures(16.0, np.random.default_rng(4))
    blob = optical.blobs(truth, "left", SETTINGS, run, (), np.random.default_rng(6))
    blob = blob.kept(blob.found)
    marker = seen(truth)
    assert blob.q is None
    assert blob.size_ratio is None
    assert len(blob.t) > 0.5 * len(marker.t)
    head_q = truth.head.pose(blob.t)[1]
    off = rotations.rotate(head_q, blob.p - target_in_head(truth, "left", blob.t)).mean(axis=0)
    assert 0.01 < off[2] < 0.08, "behind the tag, which points ahead at -z"
    assert np.trace(blob.cov[0][[0, 3, 5]] * np.eye(3)) > 2.0 * np.trace(marker.cov[0][[0, 3, 5]] * np.eye(3))


def test_false_finds_lie_on_the_floor_and_are_labelled() -> None:
    truth = made("still", 60.0)
    samples = seen(truth)
    false = samples.kept(samples.false)
    assert 3 <= len(false.t) <= 25
    head_p, head_q = truth.head.pose(false.t)
    stage = head_p + rotations.rotate(head_q, false.p)
    assert np.all((stage[:, 1] > -0.02) & (stage[:, 1] < 0.05))
    error = np.linalg.norm(samples.p - target_in_head(truth, "left", samples.t), axis=-1)
    assert error[~samples.false].max() < 0.04


def test_dictionaries_say_their_cells() -> None:
    assert camera.cells_across("DICT_4X4_50") == 6
    assert camera.cells_across("GENERATED_3X3_4") == 5
    assert camera.cells_across("DICT_APRILTAG_36h11") == 8
    assert camera.cells_across(("101010101", "010101010")) == 5
