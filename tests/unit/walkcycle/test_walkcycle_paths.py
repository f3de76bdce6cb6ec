"""Paths by arc length, footprints on them, and the clock."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pytest

from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.errors import PathError
from foottrack_service.walkcycle.footprints import plan_walk
from foottrack_service.walkcycle.measure import measure_slip
from foottrack_service.walkcycle.path import Path, circle, line, parse_path, polyline, s_curve, spline
from foottrack_service.walkcycle.presets import preset
from foottrack_service.walkcycle.timing import make_clock
from foottrack_service.walkcycle.walk import walk_along, walk_for


@pytest.mark.parametrize(
    "path", [line(4.0, 30.0), circle(2.0), circle(1.0, -90.0), s_curve(6.0), spline([(0, 0), (1, 2), (0, 4)])]
)
def test_arc_length_is_arc_length_and_heading_is_the_way(path) -> None:  # type: ignore[no-untyped-def]
    s = np.linspace(0.0, path.length, 500)
    way = np.diff(path.place(s), axis=0)
    assert np.hypot(*way.T) / np.diff(s) == pytest.approx(np.ones(499), abs=2e-3)
    middle = path.heading(0.5 * (s[1:] + s[:-1]))
    turn = np.mod(np.arctan2(way[:, 0], way[:, 1]) - middle + np.pi, 2 * np.pi) - np.pi
    assert np.max(np.abs(turn)) < 0.01


def test_a_circle_to_the_left_goes_to_the_left() -> None:
    path = circle(3.0)
    assert path.length == pytest.approx(6.0 * np.pi)
    assert path.place(np.array([0.25 * path.length]))[0] == pytest.approx([3.0, 3.0])
    assert path.offset(np.array([0.0]), 0.1)[0] == pytest.approx([0.1, 0.0])


def test_a_polylines_corner_is_rounded_within_half_a_step() -> None:
    path = polyline([(0, 0), (0, 3), (3, 3)], rounding=0.6)
    assert path.length == pytest.approx(6.0)
    s = np.array([0.0, 2.6, 3.0, 3.4, 6.0])
    assert path.heading(s) == pytest.approx([0.0, 0.0, np.pi / 4, np.pi / 2, np.pi / 2], abs=1e-3)
    assert path.place(s)[[0, 1]] == pytest.approx(np.array([[0.0, 0.0], [0.0, 2.6]]), abs=1e-3)
    assert path.place(s)[-1] == pytest.approx([3.0, 3.0], abs=0.01)


def test_one_may_turn_back_on_the_spot() -> None:
    cycle = build_cycle(preset("normative"))
    walk = walk_along(cycle, polyline([(0, 0), (0, 3), (0, 0.5)], rounding=cycle.step))
    heading, _ = walk.ground(np.array([0.0, walk.duration]))
    assert abs(heading[1] - heading[0]) == pytest.approx(np.pi, abs=1e-6)
    assert np.all(np.isfinite(walk.motion(walk.times(60.0)).rotations))


def test_files_of_points(tmp_path: FilePath) -> None:
    file = tmp_path / "way.json"
    file.write_text('{"kind": "spline", "points": [[0, 0], [0.5, 2], [0, 4]]}')
    assert parse_path(str(file)).length > 4.0
    file.write_text('{"points": [[0, 0], [0, 2], [1, 2]]}')
    assert parse_path(str(file)).length == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("line", "expected line:LENGTH"),
        ("line:far", "'far' is not a number"),
        ("line:-1", "above 0"),
        ("line:nan", "expected"),
        ("circle:0", "radius"),
        ("circle:1,0", "angle"),
        ("line:1,2,3", "expected"),
        ("nowhere.json", "nowhere.json"),
    ],
)
def test_bad_paths_name_what_is_wrong(text: str, named: str) -> None:
    with pytest.raises(PathError) as error:
        parse_path(text)
    assert named in str(error.value)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("{", "not a JSON file"),
        ('{"points": [[0, 0]]}', "two or more"),
        ('{"points": [[0, 0], [0, "x"]]}', "points"),
        ('{"points": [[0, 0], [0, 0]]}', "points 0 and 1 are the same place"),
        ('{"points": [[0, 0], [0, 1]], "kind": "knot"}', "knot"),
        ("7", "points"),
    ],
)
def test_bad_path_files_name_the_place(tmp_path: FilePath, content: str, named: str) -> None:
    file = tmp_path / "bad.json"
    file.write_text(content)
    with pytest.raises(PathError) as error:
        parse_path(str(file))
    assert named in str(error.value)
    assert "bad.json" in str(error.value)


def test_a_path_shorter_than_a_step_is_refused() -> None:
    cycle = build_cycle(preset("normative"))
    with pytest.raises(PathError, match="shorter than one step"):
        plan_walk(cycle, line(0.5))
    with pytest.raises(PathError, match="9 steps"):
        plan_walk(cycle, line(5.0), 9)
    with pytest.raises(PathError, match="at least 1"):
        plan_walk(cycle, line(5.0), 0)


def test_footprints_alternate_and_lie_beside_the_path() -> None:
    cycle = build_cycle(preset("normative"))
    plan = plan_walk(cycle, circle(3.0))
    for side, radius in (("left", 3.0 - 0.055), ("right", 3.0 + 0.055)):
        places = np.array([p.place for p in plan.footprints[side]])
        assert np.hypot(places[:, 0] - 3.0, places[:, 1]) == pytest.approx(np.full(len(places), radius), abs=1e-6)
    order = sorted((p.strike, p.side) for side in plan.footprints.values() for p in side if np.isfinite(p.strike))
    assert all(a[1] != b[1] for a, b in pairwise(order))


@pytest.mark.parametrize("path", [line(4.0, 30.0), circle(1.0, -180.0), s_curve(6.0)])
@pytest.mark.parametrize("left", [-0.11, 0.0, 0.2])
def test_a_point_beside_a_path_is_found_on_it_wherever_the_path_begins(path: Path, left: float) -> None:
    there = path.moved((2.0, -1.0), 2.5)
    assert there.place(np.zeros(1))[0] == pytest.approx([2.0, -1.0])
    assert float(there.heading(np.zeros(1))[0]) == pytest.approx(float(path.heading(np.zeros(1))[0]) + 2.5)
    for arc in (-0.05, 0.0, 0.4):
        x, z = there.offset(np.array([arc]), left)[0]
        assert there.project((float(x), float(z))) == (pytest.approx(arc, abs=1e-9), pytest.approx(left, abs=1e-9))


def test_a_moved_footprint_lies_beside_itself_on_the_path() -> None:
    path = circle(2.0)
    print_ = plan_walk(build_cycle(preset("normative")), path).footprints["left"][2]
    moved = print_.moved(path, ahead=0.1, left=0.05, turn=0.02)
    assert np.hypot(moved.place[0] - 2.0, moved.place[1]) == pytest.approx(2.0 - print_.aside - 0.05)
    assert moved.yaw - print_.yaw == pytest.approx(0.1 / 2.0 + 0.02)
    assert path.project(moved.place, near=moved.arc) == (pytest.approx(moved.arc), pytest.approx(moved.aside))


def test_footprints_moved_about_slip_no_more() -> None:
    walk = walk_along(build_cycle(preset("normative")), s_curve(6.0))
    feet = {
        side: [p.moved(walk.path, 0.01 * (-1) ** i, 0.02 * (i % 3 - 1), 0.03 * (-1) ** i) for i, p in enumerate(prints)]
        for side, prints in walk.plan.footprints.items()
    }
    walk = replace(walk, plan=replace(walk.plan, footprints=feet))
    slip = measure_slip(walk.body, walk.motion(walk.times(240.0)), walk.contacts)
    assert (slip.point_mm, slip.yaw_deg) == (pytest.approx(0.0, abs=1e-6), pytest.approx(0.0, abs=1e-6))
    assert slip.penetration_mm < 0.5


def test_the_last_steps_end_at_the_paths_end() -> None:
    plan = plan_walk(build_cycle(preset("normative")), line(5.0))
    for prints in plan.footprints.values():
        assert prints[-1].place[1] == pytest.approx(5.0)


def test_a_walk_for_some_seconds_lasts_no_longer() -> None:
    cycle = build_cycle(preset("normative"))
    walk = walk_for(cycle, circle(3.0), 8.0)
    assert 8.0 - cycle.period < walk.duration <= 8.0
    with pytest.raises(PathError, match="not one step"):
        walk_for(cycle, circle(3.0), 0.5)
    for never in (np.inf, np.nan, -1.0):
        with pytest.raises(PathError, match="lasts more than 0 s"):
            walk_for(cycle, circle(3.0), never)


def test_the_clock_is_monotone_and_its_inverse_is_its_inverse() -> None:
    clock = make_clock(-0.15, 6.0, 1.1, from_rest=True, to_rest=True, speeds=[(0.2, 0.5), (0.7, 1.8)])
    times = np.linspace(0.0, clock.duration, 300)
    phases = clock.phase(times)
    assert phases[0] == pytest.approx(-0.15)
    assert phases[-1] == pytest.approx(6.0, abs=1e-9)
    assert np.all(np.diff(phases) > 0.0)
    assert clock.time(phases) == pytest.approx(times, abs=1e-6)
    assert clock.rate([0.0, clock.duration]) == pytest.approx([0.0, 0.0], abs=1e-9)
    with pytest.raises(ValueError, match="factors"):
        make_clock(0.0, 1.0, 1.0, from_rest=False, to_rest=False, speeds=[(0.0, 99.0)])
