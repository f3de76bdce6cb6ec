"""The trackers on rendered pictures, whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
from camera_scenes import RIG, World, looking_down, passing, stepping, targets, world

from foottrack_service import rotations
from foottrack_service.camera.depth_tracker import DepthTracker
from foottrack_service.camera.detector import Detection, TagDetector, Window
from foottrack_service.camera.fix import Fix
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.marker_tracker import MarkerTracker
from foottrack_service.camera.pose import solve_target
from foottrack_service.camera.ranging import join_depth, tag_depth
from foottrack_service.camera.rendering.motion import still
from foottrack_service.camera.rendering.renderer import Shutter
from foottrack_service.camera.targets import Tag, Target

FEET = {"left": stepping(-0.1, 0.0), "right": stepping(0.1, 0.5)}


@pytest.fixture(scope="module")
def walk() -> tuple[World, list[Frame]]:
    """1.5 s of stepping, 90 pictures."""
    made = world(looking_down(), FEET, seed=3)
    return made, [made.frame(number) for number in range(90)]


def errors(made: World, fixes: list[Fix]) -> tuple[np.ndarray, np.ndarray]:
    """Position errors (n, 3), m, and their squares in units of the covariance (n,)."""
    off = np.array([fix.p - made.truth(fix.side, fix.t)[0] for fix in fixes])
    return off, np.array([e @ np.linalg.solve(fix.cov, e) for e, fix in zip(off, fixes, strict=True)])


def test_stepping_feet_are_followed(walk: tuple[World, list[Frame]]) -> None:
    made, frames = walk
    tracker = MarkerTracker(RIG, made.dictionary, made.targets)
    fixes = [fix for frame in frames for fix in tracker.process(frame)]
    assert len(fixes) > 0.9 * 2 * len(frames)
    off, squares = errors(made, fixes)
    distance = np.linalg.norm(off, axis=1)
    assert distance.mean() < 0.004 and np.percentile(distance, 95) < 0.009
    # Honest: chi-square of 3 degrees of freedom has mean 3 and is below 11.3 in 99 %.
    assert 1.0 < squares.mean() < 4.5 and np.mean(squares < 11.3) > 0.95
    ratios = [fix.size_ratio for fix in fixes if fix.size_ratio is not None]
    assert len(ratios) > 0.9 * len(fixes) and abs(np.median(ratios) - 1.0) < 0.02
    for fix in fixes:
        q = made.truth(fix.side, fix.t)[1]
        candidates = [one for one in (fix.q, fix.q_alt) if one is not None]
        assert min(float(rotations.angle_between(one, q)) for one in candidates) < 0.35
        body = fix.body()
        assert body.reproj_px is not None and body.reproj_px < 2.0


def test_rolling_shutter_is_in_the_stamp() -> None:
    # A foot that moves along the picture's columns at 2 m/s is 70 mm off between first and last row of 35 ms.
    fast = world(
        still((0.0, 1.6, 0.0), tuple(rotations.from_axis_angle([1.0, 0.0, 0.0], np.radians(-55)).tolist())),
        {"left": lambda t: (np.outer(t, [0, 0, -2.0]) + [0.0, 0.09, -0.25], np.tile([0.0, 0, 0, 1], (len(t), 1)))},
        targets()[:1],
        shutter=Shutter(0.0005, 0.035),
    )
    tracker = MarkerTracker(RIG, fast.dictionary, fast.targets)
    fixes = [fix for number in range(-3, 6) for fix in tracker.process(fast.frame(number))]
    assert len(fixes) >= 6
    stamps = np.array([fix.t - round(fix.frame / 60 * 1e9) for fix in fixes])
    assert np.ptp(stamps) > 2_000_000
    # Across the line of sight, where depth's noise is not.
    up_in_picture = RIG.covariance_to_head(np.diag([0.0, 1.0, 0.0]))
    off = np.array([fix.p - fast.truth(fix.side, fix.t)[0] for fix in fixes]) @ up_in_picture
    naive = np.array([fix.p - fast.truth(fix.side, round(fix.frame / 60 * 1e9))[0] for fix in fixes]) @ up_in_picture
    assert np.linalg.norm(off, axis=1).max() < 0.0025
    assert np.linalg.norm(naive, axis=1).max() > 0.005


def test_a_lost_tag_is_found_again_in_the_whole_picture(walk: tuple[World, list[Frame]]) -> None:
    made, frames = walk
    tracker = MarkerTracker(RIG, made.dictionary, made.targets)
    assert len(tracker.process(frames[0])) == 2 and not tracker.windows
    assert len(tracker.process(frames[1])) == 2 and set(tracker.windows) == {"left", "right"}
    for frame in frames[2:20]:
        dark = replace(frame, gray=np.zeros_like(frame.gray))
        assert tracker.process(dark) == []
    # Searched at most every 50 ms: three pictures may pass.
    found = [len(tracker.process(frame)) for frame in frames[20:25]]
    assert max(found[:4]) == 2


def test_time_that_jumps_back_only_costs_the_prediction(walk: tuple[World, list[Frame]]) -> None:
    made, frames = walk
    tracker = MarkerTracker(RIG, made.dictionary, made.targets)
    for frame in frames[:3]:
        tracker.process(frame)
    assert len(tracker.process(replace(frames[4], t=-10_000_000_000))) == 2
    assert len(tracker.process(replace(frames[5], t=-9_984_000_000))) == 2


BLOB_IN_TAG = np.array([0.0, -0.055, -0.007])
"""The middle of what is seen of the shoe, in the tag's frame: towards the heel, and a little below."""


def test_depth_finds_the_shoe_when_its_tag_is_lost(walk: tuple[World, list[Frame]]) -> None:
    made, frames = walk
    markers, depth = MarkerTracker(RIG, made.dictionary, made.targets), DepthTracker(RIG)
    fixes: list[Fix] = []
    for frame in frames:
        seen = markers.process(frame)
        # The tags are shown for a third of the time.
        fixes += depth.process(frame, seen if frame.number % 24 < 8 else [])
    whole = [fix for fix in fixes if fix.edge_px > 2.0]
    assert len(whole) > 60
    assert all(fix.kind == "depth" and fix.q is None and fix.size_ratio is None for fix in whole)
    off = []
    for fix in whole:
        p, q = made.truth(fix.side, fix.t)
        off.append(fix.p - p - rotations.rotate(q, BLOB_IN_TAG))
    distance = np.linalg.norm(off, axis=1)
    assert distance.mean() < 0.025 and np.percentile(distance, 95) < 0.045
    # The noise that is told is what changes from one picture to the next.
    squares = []
    for side in ("left", "right"):
        ours = [(fix, e) for fix, e in zip(whole, off, strict=True) if fix.side == side]
        squares += [(b - a) @ np.linalg.solve(one.cov + two.cov, b - a) for (one, a), (two, b) in pairwise(ours)]
    assert 1.0 < np.mean(squares) < 6.0


def test_depth_shows_a_seen_shoe_now_and_then(walk: tuple[World, list[Frame]]) -> None:
    made, frames = walk
    markers, depth = MarkerTracker(RIG, made.dictionary, made.targets), DepthTracker(RIG)
    found = [(frame.t, fix) for frame in frames[:60] for fix in depth.process(frame, markers.process(frame))]
    for side in ("left", "right"):
        times = [t for t, fix in found if fix.side == side]
        assert 4 <= len(times) <= 8 and np.diff(times).min() > 0.15e9
    assert len({t for t, _ in found}) == len(found)  # never both in one picture: what it costs is spread


def test_depth_without_depth_or_without_a_tag_before_says_nothing(walk: tuple[World, list[Frame]]) -> None:
    made, frames = walk
    tracker = DepthTracker(RIG)
    assert tracker.process(frames[0], []) == []
    markers = MarkerTracker(RIG, made.dictionary, made.targets)
    assert tracker.process(replace(frames[0], depth=None), markers.process(frames[0])) == []
    assert tracker.process(frames[1], []) == []


def test_depth_expects_a_shoe_for_two_seconds(walk: tuple[World, list[Frame]]) -> None:
    made, frames = walk
    for away_s, back in ((1.9, True), (2.1, False)):
        tracker = DepthTracker(RIG)
        seen = MarkerTracker(RIG, made.dictionary, made.targets).process(frames[0])
        tracker.process(replace(frames[0], t=frames[1].t - round(away_s * 1e9)), seen)
        blank = replace(frames[0], t=frames[0].t, depth=np.zeros((480, 848), np.uint16))
        assert tracker.process(blank, []) == []
        assert bool(tracker.process(frames[1], [])) == back


def test_depth_is_the_median_of_what_is_valid() -> None:
    depth = np.zeros((100, 100), np.uint16)
    depth[30:60, 30:60] = 1500
    depth[30:40, 30:60] = 0
    depth[45, 45:50] = 4000
    frame = Frame(np.zeros((100, 100), np.uint8), depth, 0, 0)
    found = tag_depth(frame, np.array([[30.0, 30.0], [59.0, 30.0], [59.0, 59.0], [30.0, 59.0]]), 0.0038)
    assert found is not None and found.z == pytest.approx(1.5) and 0.001 < found.sigma < 0.0086
    outside = np.array([[70.0, 70.0], [90.0, 70.0], [90.0, 90.0], [70.0, 90.0]])
    assert tag_depth(frame, outside, 0.0038) is None
    assert tag_depth(frame, outside + 500.0, 0.0038) is None


@pytest.mark.parametrize(("true_m", "used"), [(1.52, True), (2.2, False), (0.9, False)])
def test_depth_that_contradicts_the_size_is_told_and_not_used(true_m: float, used: bool) -> None:
    target = Target("left", (Tag(0, 0.06),))
    corners = RIG.intrinsics.project(target.corners[0] * [1, -1, -1] + [0.05, 0.02, 1.5])
    seen = [Detection(0, corners)]
    pose = solve_target(target, seen, RIG.intrinsics)
    assert pose is not None
    frame = Frame(np.zeros((480, 848), np.uint8), np.full((480, 848), round(true_m * 1000), np.uint16), 0, 0)
    p, cov, ratio = join_depth(pose, target, seen, frame, 0.0038)
    assert ratio == pytest.approx(true_m / 1.5, rel=0.01)
    assert p[2] == pytest.approx(1.52 if used else 1.5, abs=0.004)
    assert (cov[2, 2] < 0.5 * pose.cov[2, 2]) == used
    assert np.linalg.eigvalsh(cov).min() > 0.0


def rates(size: float, distance: float, blur: float, dictionary: str = "DICT_4X4_50") -> tuple[float, float]:
    """Share of 16 pictures in which the tag is found in its window, and in the whole picture by OpenCV's defaults."""
    in_window, by_default = 0, 0
    for seed in range(16):
        made, corners = passing(size, distance, blur, dictionary, seed)
        gray = made.frame(0).gray
        px = size * RIG.intrinsics.focal / distance
        low, high = (corners.mean(axis=0) + sign * 2.0 * px for sign in (-1, 1))
        window = Window(int(low[0]), int(low[1]), int(high[0]), int(high[1]), px)
        found = TagDetector(made.dictionary, [0]).look(gray, window)
        in_window += bool(found) and float(np.abs(found[0].corners - corners).max()) < 0.5 * px
        ids = cv2.aruco.ArucoDetector(made.dictionary, cv2.aruco.DetectorParameters()).detectMarkers(gray)[1]
        by_default += ids is not None and 0 in np.asarray(ids)
    return in_window / 16, by_default / 16


def test_hit_rates_against_blur_and_distance() -> None:
    # ALGORITHMS 3, for the detector as it comes: at 1.5 m every sharp 6 cm tag; with 8 px of blur 2 to 16 % of them,
    # and 85 % of 10 cm tags. The window's own settings find more.
    assert rates(0.06, 1.5, 0.0) == (1.0, 1.0)
    ours, default = rates(0.06, 1.5, 8.0)
    assert default <= 0.2 and default <= ours <= 0.6
    ours, default = rates(0.10, 1.5, 8.0)
    assert 0.75 <= default <= ours
    # Fewer cells beat any change of detector, and distance beats all.
    ours, default = rates(0.06, 1.5, 8.0, "GENERATED_3X3_4")
    assert ours >= 0.75 > default
    assert rates(0.06, 2.5, 8.0) == (0.0, 0.0)


def test_corners_of_small_tags_are_good_to_a_quarter_pixel() -> None:
    errors = []
    for seed in range(16):
        made, corners = passing(0.06, 1.5, 0.0, "DICT_4X4_50", seed)
        centre = corners.mean(axis=0)
        window = Window(*(int(c) - 50 for c in centre), *(int(c) + 50 for c in centre), 24.5)
        errors += [d.corners - corners for d in TagDetector(made.dictionary, [0]).look(made.frame(0).gray, window)]
    assert len(errors) == 16
    assert np.sqrt(np.mean(np.square(errors))) < 0.25
    assert np.abs(np.mean(errors, axis=(0, 1))).max() < 0.05  # no half pixel lost in upscaling


def test_several_tags_are_one_target() -> None:
    lean = tuple(rotations.from_axis_angle([1.0, 0.0, 0.0], -0.6).tolist())
    shoe = Target("left", (Tag(3, 0.04, (0.0, 0.0, 0.0)), Tag(4, 0.04, (0.0, -0.055, 0.012), lean)))
    head = still((0.0, 1.3, 0.1), tuple(rotations.from_axis_angle([1.0, 0.0, 0.0], np.radians(-55)).tolist()))
    made = world(head, {"left": still((0.02, 0.09, -0.25))}, [shoe])
    tracker = MarkerTracker(RIG, made.dictionary, [shoe])
    fixes = [fix for number in range(4) for fix in tracker.process(made.frame(number))]
    assert len(fixes) == 4
    assert [len(fix.outline) for fix in fixes[1:]] == [8, 8, 8]
    off, _ = errors(made, fixes)
    assert np.linalg.norm(off, axis=1).max() < 0.008
