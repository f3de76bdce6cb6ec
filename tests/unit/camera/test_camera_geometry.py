"""Rig, dictionaries, targets, planar choice, pose: against hand-made values and other formulas."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from camera_scenes import RIG
from hypothesis import example, given, settings
from hypothesis import strategies as st

from foottrack_service import rotations
from foottrack_service.camera import dictionaries
from foottrack_service.camera.detector import Detection, TagDetector
from foottrack_service.camera.planar import choose_by_attitude, choose_by_up
from foottrack_service.camera.pose import CORNER_SIGMA_PX, solve_target
from foottrack_service.camera.rig import D435_COLOUR, Intrinsics, Rig
from foottrack_service.camera.targets import Tag, Target, owners


def test_what_lies_ahead_of_a_level_camera_lies_ahead_of_the_head() -> None:
    rig = Rig(D435_COLOUR, (0.0, 0.0, -0.08), (0.0, 0.0, 0.0, 1.0))
    # 1 m ahead, 0.2 right, 0.3 below: OpenCV says z = 1, x = 0.2, y = 0.3 (down).
    np.testing.assert_allclose(rig.to_head([0.2, 0.3, 1.0]), [0.2, -0.3, -1.08], atol=1e-12)
    np.testing.assert_allclose(rig.from_head([0.2, -0.3, -1.08]), [0.2, 0.3, 1.0], atol=1e-12)


def test_the_default_mount_looks_20_degrees_down() -> None:
    ahead = RIG.to_head([0.0, 0.0, 1.0]) - RIG.to_head([0.0, 0.0, 0.0])
    np.testing.assert_allclose(ahead, [0.0, -np.sin(np.radians(20)), -np.cos(np.radians(20))], atol=1e-6)


def test_a_covariance_turns_with_the_points() -> None:
    source = np.random.default_rng(0)
    cov = np.diag([1.0, 4.0, 25.0])
    points = source.multivariate_normal([0, 0, 2], cov, 40000)
    np.testing.assert_allclose(np.cov(RIG.to_head(points).T), RIG.covariance_to_head(cov), atol=0.6)


def test_rays_undo_projection_with_distortion() -> None:
    lens = Intrinsics(640, 480, 500.0, 510.0, 320.0, 240.0, (-0.27, 0.09, 0.001, -0.0005, 0.01))
    points = np.array([[0.1, -0.2, 1.0], [-0.4, 0.3, 1.2], [0.0, 0.0, 2.0]])
    np.testing.assert_allclose(lens.rays(lens.project(points)), points[:, :2] / points[:, 2:], atol=1e-5)


@pytest.mark.parametrize(
    "wrong",
    [{"fx": 0.0}, {"cx": float("nan")}, {"width": 0}, {"distortion": (0.1, 0.2)}],
)
def test_a_lens_that_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    values: dict[str, object] = {"width": 640, "height": 480, "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}
    with pytest.raises(ValueError):
        Intrinsics(**{**values, **wrong})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", dictionaries.predefined_names())
def test_every_dictionary_of_opencv_is_drawn_as_opencv_draws_it(name: str) -> None:
    dictionary = dictionaries.load_dictionary(name)
    cells = dictionaries.tag_cells(dictionary, 3)
    drawn = cv2.aruco.generateImageMarker(dictionary, 3, cells.shape[0])
    np.testing.assert_array_equal(cells * 255, drawn)


@pytest.mark.parametrize("spec", ["GENERATED_3X3_4", "GENERATED_4X4_6", ["110000001", "100110011"]])
def test_own_tags_are_found_by_their_id_in_any_turn(spec: dictionaries.DictionarySpec) -> None:
    dictionary = dictionaries.load_dictionary(spec)
    count = len(dictionary.bytesList)
    detector = TagDetector(dictionary, range(count))
    for tag in range(count):
        for turn in range(4):
            cells = np.rot90(np.pad(dictionaries.tag_cells(dictionary, tag), 2, constant_values=1), turn)
            picture = np.kron(cells * 255, np.ones((12, 12))).astype(np.uint8)
            found = detector.search(np.ascontiguousarray(picture))
            assert [detection.id for detection in found] == [tag]
            low, high = 23.5, 23.5 + 12 * (cells.shape[0] - 4)
            square = np.array([[low, low], [high, low], [high, high], [low, high]])
            np.testing.assert_allclose(found[0].corners, np.roll(square, turn, axis=0), atol=0.3)


def test_generated_tags_never_change() -> None:
    # What is printed on a shoe outlives the version that printed it.
    tags = dictionaries.generate_tags(3, 4)
    assert ["".join(map(str, tag.ravel())) for tag in tags] == GENERATED_3X3_4


GENERATED_3X3_4 = ["111000000", "001110000", "110111000", "101101010"]


@pytest.mark.parametrize("name", ["DICT_9X9_50", "4X4", "GENERATED_3X4_2", "GENERATED_2X2_50", ""])
def test_unknown_dictionaries_are_refused(name: str) -> None:
    with pytest.raises(ValueError):
        dictionaries.load_dictionary(name)


@pytest.mark.parametrize("tags", [[], ["0110"], ["110000001", "110000001"], ["110000001", "100000011"], ["11", "1x00"]])
def test_custom_tags_that_could_be_confused_are_refused(tags: list[str]) -> None:
    # The second pair is one tag and its own quarter turn; 0110 looks the same after half a turn.
    with pytest.raises(ValueError):
        dictionaries.load_dictionary(tags)


def test_two_targets_cannot_share_a_tag() -> None:
    with pytest.raises(ValueError, match="tag 0 is on the left and on the right"):
        owners([Target("left", (Tag(0, 0.06),)), Target("right", (Tag(0, 0.06),))])


unit = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: sum(c * c for c in q) > 0.1)


@given(unit, unit)
def test_the_attitude_that_agrees_with_up_is_chosen(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    right, other = rotations.normalised(a), rotations.normalised(b)
    up_in_tag = np.array([0.1, 0.2, 0.9])
    up = rotations.rotate(right, up_in_tag)
    for pair in ((right, other), (other, right)):
        chosen = choose_by_up(*pair, 3.0 * up, up_in_tag)
        assert rotations.rotate(chosen, up_in_tag) @ up >= rotations.rotate(other, up_in_tag) @ up - 1e-12
    np.testing.assert_array_equal(choose_by_up(other, None, up, up_in_tag), other)
    assert rotations.angle_between(choose_by_attitude(other, right, right), right) < 1e-6


@pytest.mark.parametrize("up", [(0.0, 0.0, 0.0), (float("nan"), 0.0, 1.0)])
def test_no_up_is_no_answer(up: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError):
        choose_by_up((0, 0, 0, 1), (1, 0, 0, 0), up, (0, 0, 1))


def random_pose(source: np.random.Generator, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """A tag that faces the camera within some 40 degrees."""
    q = rotations.multiply([1.0, 0.0, 0.0, 0.0], rotations.from_rotation_vector(source.normal(0.0, 0.4, 3)))
    return distance * np.array([source.uniform(-0.3, 0.3), source.uniform(-0.2, 0.2), 1.0]), q


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.4, 2.5))
@example(811, 0.4921875)  # both of IPPE's solutions end near the truth, the worse one first
def test_exact_corners_give_the_exact_pose(seed: int, distance: float) -> None:
    source = np.random.default_rng(seed)
    p, q = random_pose(source, distance)
    lens = Intrinsics(848, 480, 612.0, 610.0, 420.0, 241.0, (0.05, -0.1, 0.001, 0.0, 0.02))
    target = Target("left", (Tag(5, 0.06),))
    seen = Detection(5, lens.project(target.corners[5] @ rotations.to_matrix(q).T + p))
    pose = solve_target(target, [seen], lens)
    assert pose is not None
    found = [pose.q] if pose.q_alt is None else [pose.q, pose.q_alt]
    # Two solutions fit exactly when the tag faces the camera; one of them is the truth.
    assert min(float(rotations.angle_between(one, q)) for one in found) < 0.02
    np.testing.assert_allclose(pose.p, p, atol=2e-3 * distance)
    assert pose.reproj_px < 0.05


def test_small_tags_flip_as_often_as_real_ones_and_up_resolves_all() -> None:
    source = np.random.default_rng(1)
    target = Target("left", (Tag(0, 0.06),))
    flips, wrong, squares = 0, 0, []
    for _ in range(300):
        p, q = random_pose(source, 1.5)
        exact = D435_COLOUR.project(target.corners[0] @ rotations.to_matrix(q).T + p)
        pose = solve_target(target, [Detection(0, exact + source.normal(0, CORNER_SIGMA_PX, (4, 2)))], D435_COLOUR)
        assert pose is not None
        flips += bool(rotations.angle_between(pose.q, q) > 0.35)
        up = np.array([0.0, -0.9, -0.4])
        chosen = choose_by_up(pose.q, pose.q_alt, up, rotations.unrotate(q, up))
        wrong += bool(rotations.angle_between(chosen, q) > 0.6)
        error = pose.p - p
        squares.append(error @ np.linalg.solve(pose.cov, error))
    assert 0.10 < flips / 300 < 0.25
    assert wrong <= 1
    # Consistent: the mean of a chi-square of 3 degrees of freedom is 3.
    assert 2.0 < np.mean(squares) < 4.0


def test_two_tags_on_different_planes_leave_one_solution() -> None:
    source = np.random.default_rng(2)
    lean = tuple(rotations.from_axis_angle([1.0, 0.0, 0.0], 0.7).tolist())
    target = Target("left", (Tag(0, 0.05, (0.0, 0.04, 0.0)), Tag(1, 0.05, (0.0, -0.04, -0.02), lean)))
    alternatives, spreads = 0, []
    for _ in range(60):
        p, q = random_pose(source, 1.3)
        R = rotations.to_matrix(q)
        seen = [
            Detection(i, D435_COLOUR.project(target.corners[i] @ R.T + p) + source.normal(0, 0.2, (4, 2)))
            for i in (0, 1)
        ]
        pose = solve_target(target, seen, D435_COLOUR)
        assert pose is not None
        assert rotations.angle_between(pose.q, q) < 0.3
        alternatives += pose.q_alt is not None
        single = solve_target(target, seen[:1], D435_COLOUR)
        assert single is not None
        spreads.append((np.trace(pose.cov), np.trace(single.cov)))
    assert alternatives < 12
    both, one = np.mean(spreads, axis=0)
    assert both < 0.6 * one


def test_no_tag_no_pose() -> None:
    assert solve_target(Target("left", (Tag(0, 0.06),)), [], D435_COLOUR) is None
