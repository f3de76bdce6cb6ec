"""Calibration of lens and floor from synthetic views, and what is refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from camera_scenes import RIG, looking_down, stepping, world

from foottrack_service import rotations
from foottrack_service.camera.boards import CharucoBoard, Chessboard, View
from foottrack_service.camera.calibration import (
    CalibrationError,
    calibrate,
    coverage_hints,
    covered,
    is_new,
)
from foottrack_service.camera.floor import FloorError, Plane, calibrate_floor, find_floor
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.rig import Intrinsics, Rig

LENS = Intrinsics(640, 480, 530.0, 528.0, 322.0, 236.0, (-0.2, 0.06, 0.001, -0.0008, 0.0))
GRID = np.column_stack([np.mgrid[0:9, 0:6].T.reshape(-1, 2) * 0.025, np.zeros(54)]) - [0.1, 0.0625, 0.0]


def views(count: int = 15, tilt: float = 0.6, spread: float = 1.0, noise: float = 0.1, seed: int = 0) -> list[View]:
    """Views of a 9x6 board all over the picture."""
    source = np.random.default_rng(seed)
    made: list[View] = []
    while len(made) < count:
        R = rotations.to_matrix(rotations.from_rotation_vector(source.uniform(-tilt, tilt, 3)))
        place = np.array([*(spread * source.uniform((-0.22, -0.16), (0.22, 0.16))), source.uniform(0.38, 0.6)])
        image = LENS.project(GRID @ R.T + place)
        if image.min() > 5 and image[:, 0].max() < 635 and image[:, 1].max() < 475:
            made.append(View(GRID, image + source.normal(0.0, noise, image.shape)))
    return made


def test_a_lens_is_found_again() -> None:
    found = calibrate(views(20), 640, 480)
    lens = found.intrinsics
    assert (lens.fx, lens.fy, lens.cx, lens.cy) == pytest.approx((530, 528, 322, 236), abs=2.0)
    assert found.rms == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert abs(lens.fx - 530.0) < 4.0 * found.focal_sigma < 8.0
    u, v = np.meshgrid(np.linspace(60, 580, 9), np.linspace(60, 420, 7))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    rays = np.column_stack([LENS.rays(pixels), np.ones(pixels.shape[0])])
    assert np.abs(lens.project(rays) - pixels).max() < 1.0


@pytest.mark.parametrize(
    ("bad", "text"),
    [
        (lambda: views(5), "5 views show the board; 8 are needed"),
        (lambda: views(12, spread=0.05, tilt=0.2), "of the picture only: show the board at the"),
        (lambda: views(20, noise=2.0), "corners miss by"),
        (lambda: views(24, tilt=0.05), "tilt the board|focal length is known"),
    ],
)
def test_bad_sets_are_refused(bad: object, text: str) -> None:
    with pytest.raises(CalibrationError, match=text):
        calibrate(bad(), 640, 480)  # type: ignore[operator]


def test_hints_name_what_is_missing() -> None:
    left = [view for view in views(40) if view.image[:, 0].max() < 480]
    hints = coverage_hints(left, 640, 480)
    assert hints and all("right" in hint for hint in hints if hint.startswith("show"))
    assert coverage_hints(views(40), 640, 480) == []
    assert covered([], 640, 480).sum() == 0
    assert coverage_hints([], 640, 480)[-1].startswith("8 more views")


def test_a_view_counts_once() -> None:
    first, second = views(2)
    assert is_new(first, [], 640) and is_new(second, [first], 640)
    assert not is_new(View(first.model, first.image + 3.0), [first], 640)


def test_boards_are_found_in_pictures_of_them() -> None:
    board = CharucoBoard(5, 7, 0.04, 0.02, "DICT_6X6_250")
    drawn = board._detector[0].generateImage((500, 700), marginSize=50)
    view = board.find(drawn)
    assert view is not None and len(view.image) == 24
    # 4 x 6 inner corners, 40 mm = 80 px apart.
    np.testing.assert_allclose(np.ptp(view.image, axis=0), [240.0, 400.0], atol=1.5)
    np.testing.assert_allclose(np.ptp(view.model, axis=0)[:2], [0.12, 0.20], atol=1e-9)
    assert board.find(np.full((480, 640), 128, np.uint8)) is None
    chess = np.kron(np.indices((7, 10)).sum(axis=0) % 2 * 255, np.ones((30, 30))).astype(np.uint8)
    found = Chessboard(9, 6, 0.025).find(cv2.copyMakeBorder(chess, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255))
    assert found is not None
    steps = np.linalg.norm(np.diff(found.image.reshape(6, 9, 2), axis=1), axis=2)
    np.testing.assert_allclose(steps, 30.0, atol=0.1)


def photo(R: np.ndarray, place: np.ndarray, noise: np.random.Generator) -> np.ndarray:
    """A 10 x 7 board of 25 mm as LENS sees it: each pixel's ray is followed to the board, four to a pixel."""
    squares = np.pad(
        np.kron(np.indices((7, 10)).sum(axis=0) % 2, np.ones((40, 40))) * 190 + 35, 40, constant_values=225
    )
    u, v = np.meshgrid(np.arange(1280) / 2 - 0.25, np.arange(960) / 2 - 0.25)
    rays = LENS.rays(np.stack([u.ravel(), v.ravel()], axis=1))
    along = np.column_stack([rays, np.ones(len(rays))]) @ R
    eye = -R.T @ place
    x, y = (eye[i] - eye[2] / along[:, 2] * along[:, i] for i in (0, 1))
    at = [((w / 0.025 + 2.0) * 40 - 0.5).reshape(960, 1280).astype(np.float32) for w in (x, y)]
    drawn = cv2.remap(squares.astype(np.uint8), *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=110)
    small = cv2.resize(drawn, (640, 480), interpolation=cv2.INTER_AREA)
    return np.clip(cv2.GaussianBlur(small, (0, 0), 0.6) + noise.normal(0.0, 2.0, small.shape), 0, 255).astype(np.uint8)


def test_corners_are_refined_where_no_other_corner_reaches() -> None:
    source = np.random.default_rng(5)
    pictures: list[np.ndarray] = []
    model = GRID - GRID[0]
    outline = np.array([[x, y, 0.0] for x in (-0.05, 0.25) for y in (-0.05, 0.175)])
    while len(pictures) < 10:
        R = rotations.to_matrix(rotations.from_rotation_vector(source.uniform(-0.75, 0.75, 3) * [1.0, 1.0, 0.5]))
        place = np.array([*source.uniform((-0.2, -0.15), (0.2, 0.15)), source.uniform(0.4, 0.62)]) - R @ [
            0.1,
            0.0625,
            0,
        ]
        pixels = LENS.project(outline @ R.T + place)
        if pixels.min() > 0 and pixels[:, 0].max() < 640 and pixels[:, 1].max() < 480:
            pictures.append(photo(R, place, source))
    errors = {}
    for refine in (None, 11):
        seen = [view for view in (Chessboard(9, 6, 0.025, refine).find(picture) for picture in pictures) if view]
        np.testing.assert_allclose(seen[0].model, model, atol=1e-12)
        flat, image = [view.model for view in seen], [view.image for view in seen]
        rms, matrix, *_ = cv2.calibrateCamera(
            [f.astype(np.float32) for f in flat],
            [i.astype(np.float32) for i in image],
            (640, 480),
            np.eye(3),
            np.zeros(5),
        )
        errors[refine] = (rms, abs(matrix[0, 0] - LENS.fx))
    assert errors[None][0] < 0.1 and errors[None][1] < 1.0
    # OpenCV's own example refines within 11 px, whatever the distance of the next corner.
    assert errors[11][0] > 3.0 * errors[None][0] and errors[11][1] > errors[None][1]


def test_the_floor_is_found_under_feet_and_calibrates_its_height() -> None:
    made = world(looking_down(), {"left": stepping(-0.1, 0.0), "right": stepping(0.1, 0.5)})
    planes, heads, last = [], [], None
    for number in range(12):
        last = find_floor(made.frame(4 * number), RIG.intrinsics, last)
        assert last is not None and last.share > 0.8 and last.rms < 0.02
        t = np.array([4 * number / 60])
        p, q = made.scene.head(t)
        planes.append(last)
        heads.append((p[0], q[0]))
    found = calibrate_floor(planes, heads, RIG)
    assert abs(found.height) < 0.005 and found.tilt < np.radians(0.5)
    tilted = Rig(RIG.intrinsics, RIG.mount_p, tuple(rotations.from_axis_angle([1, 0, 0], np.radians(-26)).tolist()))
    with pytest.raises(FloorError, match=r"tilt by 6\.\d deg: check \[camera\] mount"):
        calibrate_floor(planes, heads, tilted)
    with pytest.raises(FloorError, match="scatter"):
        calibrate_floor(planes, [(p + [0, 0.05 * (i % 2), 0], q) for i, (p, q) in enumerate(heads)], RIG)
    with pytest.raises(FloorError, match="3 pictures"):
        calibrate_floor(planes[:3], heads[:3], RIG)


def test_no_floor_in_nothing_or_in_a_wall() -> None:
    blank = Frame(np.zeros((480, 848), np.uint8), np.zeros((480, 848), np.uint16), 0, 0)
    assert find_floor(blank, RIG.intrinsics) is None
    wall = Frame(blank.gray, np.full((480, 848), 200, np.uint16), 0, 0)
    assert find_floor(wall, RIG.intrinsics) is None  # 20 cm away: no floor is


def test_height_above_a_plane() -> None:
    plane = Plane(np.array([0.0, -1.0, 0.0]), 1.5, 1.0, 0.0)
    np.testing.assert_allclose(plane.above([[0.0, 1.5, 1.0], [0.3, 1.2, 2.0]]), [0.0, 0.3])
