"""Planted feet do not slip: by forward kinematics of what is read back from the files, and the test can fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from foottrack_service.walkcycle import walk as walk_module
from foottrack_service.walkcycle.bvh import as_humanoid, format_bvh, parse_bvh
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.frames import even_frames
from foottrack_service.walkcycle.glb import format_glb, key_times, parse_glb
from foottrack_service.walkcycle.measure import Slip, denser, measure_slip
from foottrack_service.walkcycle.path import parse_path
from foottrack_service.walkcycle.presets import PRESETS, preset
from foottrack_service.walkcycle.skeleton import INDEX, Humanoid, forward_kinematics
from foottrack_service.walkcycle.walk import Motion, Targets, Walk, close_legs, walk_along

PATHS = ("line:4", "line:4,30", "circle:1,180", "circle:3,90", "circle:1,-180", "s:6", "corner:2", "corner:2,-120")


def _walk(name: str, path: str) -> Walk:
    cycle = build_cycle(preset(name))
    return walk_along(cycle, parse_path(path, rounding=cycle.step))


def _from_bvh(walk: Walk, motion: Motion) -> Motion:
    return as_humanoid(parse_bvh(format_bvh(walk.body, motion)))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("name", PRESETS)
def test_nothing_slips(name: str, path: str) -> None:
    walk = _walk(name, path)
    exact = measure_slip(walk.body, walk.motion(walk.times(120.0)), walk.contacts)
    assert exact.contacts >= 8
    assert exact.point_mm < 0.01
    assert exact.yaw_deg < 0.01
    assert exact.penetration_mm < 0.5

    frames = even_frames(walk, 60.0)
    read = _from_bvh(walk, frames.motion(walk))
    _check_file(measure_slip(walk.body, read, frames.contacts(walk)))
    _check_between(measure_slip(walk.body, denser(read), frames.contacts(walk)))

    times = key_times(walk, 60.0)
    read = parse_glb(format_glb(walk.body, walk.motion(times)))
    # Single precision moves a key by half a microsecond against the contact it belongs to.
    _check_file(measure_slip(walk.body, replace(read, times=times), walk.contacts))
    _check_between(measure_slip(walk.body, denser(replace(read, times=times)), walk.contacts))


def _check_file(slip: Slip) -> None:
    assert slip.point_mm < 0.1
    assert slip.yaw_deg < 0.01
    assert slip.penetration_mm < 0.5


def _check_between(slip: Slip) -> None:
    assert slip.point_mm < 0.5
    assert slip.penetration_mm < 0.5


def _measured(walk: Walk, targets: Targets, times: np.ndarray) -> Slip:
    motion = close_legs(walk.body, times, targets)
    return measure_slip(walk.body, _from_bvh(walk, motion), walk.contacts)


def test_a_footprint_moved_by_a_millimetre_is_noticed() -> None:
    walk = _walk("normative", "line:4")
    times = walk.times(60.0)
    targets = walk.targets(times)
    middle = walk.contacts[3]
    assert middle.heel is not None
    moved = targets.feet[middle.side].ankle.copy()
    moved[times > np.mean(middle.heel), 2] += 0.001
    feet = {**targets.feet, middle.side: replace(targets.feet[middle.side], ankle=moved)}
    assert _measured(walk, targets, times).point_mm < 0.1
    assert _measured(walk, replace(targets, feet=feet), times).point_mm == pytest.approx(1.0, abs=0.05)


def test_a_dropped_ball_pivot_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    walk = _walk("sneak", "line:4")
    times = walk.times(60.0)
    rolled = walk_module.rolled_ankle
    monkeypatch.setattr(
        walk_module, "rolled_ankle", lambda body, pitch, share: rolled(body, pitch, 0.0 * np.asarray(share))
    )
    assert _measured(walk, walk.targets(times), times).point_mm > 10.0


def test_a_leg_that_comes_a_frame_late_is_noticed() -> None:
    walk = _walk("normative", "line:4")
    times = walk.times(60.0)
    motion = walk.motion(times)
    late = motion.rotations.copy()
    legs = [INDEX[f"right{part}"] for part in ("UpperLeg", "LowerLeg", "Foot", "Toes")]
    late[1:, legs] = motion.rotations[:-1, legs]
    read = _from_bvh(walk, replace(motion, rotations=late))
    assert measure_slip(walk.body, read, walk.contacts).point_mm > 5.0


@pytest.mark.parametrize("name", PRESETS)
def test_legs_reach_exactly_and_bones_do_not_stretch(name: str) -> None:
    walk = _walk(name, "circle:1,180")
    times = walk.times(60.0)
    targets, motion = walk.targets(times), walk.motion(times)
    places, _ = forward_kinematics(walk.body.offsets, motion.hips, motion.rotations)
    for side, foot in targets.feet.items():
        ankle = places[:, INDEX[f"{side}Foot"]]
        assert np.max(np.linalg.norm(ankle - foot.ankle, axis=1)) < 1e-9
        knee, hip = places[:, INDEX[f"{side}LowerLeg"]], places[:, INDEX[f"{side}UpperLeg"]]
        # The knee lies ahead of the line from hip to ankle: it never bends backwards.
        assert np.all(_bend(hip, knee, ankle, motion) > 0.0)


def _bend(hip: np.ndarray, knee: np.ndarray, ankle: np.ndarray, motion: Motion) -> np.ndarray:
    from foottrack_service import rotations as rot

    along = (ankle - hip) / np.linalg.norm(ankle - hip, axis=1, keepdims=True)
    out = knee - hip - np.sum((knee - hip) * along, axis=1, keepdims=True) * along
    return np.sum(out * rot.rotate(motion.rotations[:, 0], [0.0, 0.0, 1.0]), axis=1)


def test_changing_speed_slips_no_more() -> None:
    cycle = build_cycle(preset("normative"))
    walk = walk_along(cycle, parse_path("s:8"), speeds=[(0.0, 0.6), (0.5, 1.6), (1.0, 0.8)])
    slip = measure_slip(walk.body, walk.motion(walk.times(120.0)), walk.contacts)
    assert slip.point_mm < 0.01
    _, speed = walk.ground(np.array([0.0, 0.5 * walk.duration, walk.duration]))
    assert speed[1] > 1.3 * cycle.speed
    assert abs(speed[0]) < 0.05
    assert abs(speed[2]) < 0.05


def test_a_walk_starts_and_stops_at_rest_with_feet_side_by_side() -> None:
    walk = _walk("normative", "line:4")
    motion = walk.motion(np.array([0.0, 1e-3, walk.duration - 1e-3, walk.duration]))
    assert np.max(np.abs(motion.hips[1] - motion.hips[0])) < 1e-4
    assert np.max(np.abs(motion.hips[3] - motion.hips[2])) < 1e-4
    ends = walk.targets([0.0, walk.duration])
    for foot in ends.feet.values():
        assert foot.ankle[:, 2] == pytest.approx([0.0, 4.0], abs=1e-9)
        assert np.allclose(foot.pitch, 0.0)


@pytest.mark.parametrize("height", [1.2, 1.95])
def test_another_body_walks_without_slip(height: float) -> None:
    body = Humanoid(height)
    own, other = build_cycle(preset("normative")), build_cycle(preset("normative"), body)
    assert other.stride / own.stride == pytest.approx(body.leg / own.body.leg)
    assert other.speed**2 / body.leg == pytest.approx(own.speed**2 / own.body.leg)
    walk = walk_along(other, parse_path("circle:2,120"))
    assert measure_slip(body, walk.motion(walk.times(120.0)), walk.contacts).point_mm < 0.01


def test_a_moment_without_contact_is_legal() -> None:
    project = preset("normative")
    flying = project.model_copy(
        update={"contact": project.contact.model_copy(update={"heel_off": 0.25, "toe_off": 0.42})}
    )
    walk = walk_along(build_cycle(flying), parse_path("line:5"), 6, start=False, stop=False)
    phases = walk.clock.phase(walk.times(200.0))
    stands = np.zeros_like(phases, dtype=bool)
    for prints in walk.plan.footprints.values():
        for p in prints:
            stands |= (phases >= p.strike) & (phases <= p.toe_off)
    assert 0.1 < np.mean(~stands) < 0.2
    assert measure_slip(walk.body, walk.motion(walk.times(200.0)), walk.contacts).point_mm < 0.01


def test_the_pelvis_moves_smoothly() -> None:
    walk = _walk("normative", "corner:3")
    times = np.linspace(0.0, walk.duration, 4001)
    hips = walk.targets(times).hips
    jumps = np.linalg.norm(np.diff(hips, axis=0), axis=1) / np.diff(times)
    assert np.max(jumps) < 2.5
