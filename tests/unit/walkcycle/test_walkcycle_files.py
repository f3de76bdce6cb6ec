"""BVH and GLB: round trips, other people's readers, files that are broken; every export walks towards its face."""

from __future__ import annotations

from random import Random

import bvh as pypi_bvh
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from foottrack_service.walkcycle.bvh import as_humanoid, format_bvh, parse_bvh
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.errors import MotionFileError
from foottrack_service.walkcycle.frames import contact_edges, even_frames
from foottrack_service.walkcycle.glb import format_glb, key_times, parse_glb
from foottrack_service.walkcycle.measure import foot_points
from foottrack_service.walkcycle.path import parse_path
from foottrack_service.walkcycle.presets import preset
from foottrack_service.walkcycle.skeleton import INDEX, JOINTS, PARENTS, forward_kinematics
from foottrack_service.walkcycle.walk import Motion, Walk, walk_along


@pytest.fixture(scope="module")
def walk() -> Walk:
    cycle = build_cycle(preset("animator"))
    return walk_along(cycle, parse_path("s:5"))


def _apart_mm(walk: Walk, one: Motion, two: Motion) -> float:
    a, _ = forward_kinematics(walk.body.offsets, one.hips, one.rotations)
    b, _ = forward_kinematics(walk.body.offsets, two.hips, two.rotations)
    return 1e3 * float(np.max(np.linalg.norm(a - b, axis=-1)))


def test_a_bvh_comes_back(walk: Walk) -> None:
    motion = even_frames(walk, 30.0).motion(walk)
    file = parse_bvh(format_bvh(walk.body, motion))
    assert set(file.names) == set(JOINTS)
    assert np.allclose(file.offsets[0], 0.0)
    assert file.motion.times == pytest.approx(motion.times, abs=1e-7)
    assert _apart_mm(walk, motion, as_humanoid(file)) < 0.01


def test_a_glb_comes_back(walk: Walk) -> None:
    motion = walk.motion(key_times(walk, 30.0))
    read = parse_glb(format_glb(walk.body, motion))
    assert read.times == pytest.approx(motion.times, abs=1e-6)
    assert _apart_mm(walk, motion, read) < 0.01


def test_a_glb_has_keys_at_the_contacts(walk: Walk) -> None:
    read = parse_glb(format_glb(walk.body, walk.motion(key_times(walk, 24.0))))
    for edge in contact_edges(walk, flat=True):
        assert np.min(np.abs(read.times - edge)) < 1e-5
    assert np.all(np.diff(read.times) > 0.0)


def test_neighbouring_rotations_never_change_sign(walk: Walk) -> None:
    read = parse_glb(format_glb(walk.body, walk.motion(key_times(walk, 24.0))))
    assert np.min(np.sum(read.rotations[1:] * read.rotations[:-1], axis=-1)) > 0.0


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0])
def test_frames_put_contacts_on_frames_and_bend_time_by_half_a_frame(walk: Walk, fps: float) -> None:
    frames = even_frames(walk, fps)
    assert np.all(np.diff(frames.instants) > 0.0)
    assert np.max(np.abs(frames.instants - frames.times)) <= 0.6 / fps
    for edge in contact_edges(walk):
        assert np.min(np.abs(frames.instants - edge)) < 1e-9


def test_the_pypi_parser_reads_our_bvh(walk: Walk) -> None:
    motion = even_frames(walk, 30.0).motion(walk)
    read = pypi_bvh.Bvh(format_bvh(walk.body, motion))
    assert sorted(read.get_joints_names()) == sorted(JOINTS)
    assert read.nframes == len(motion.times)
    assert read.frame_time == pytest.approx(1.0 / 30.0, abs=1e-9)
    assert read.joint_offset("hips") == (0.0, 0.0, 0.0)
    frame = 40
    places: dict[str, np.ndarray] = {}
    turns: dict[str, Rotation] = {}
    for name in read.get_joints_names():
        angles = read.frame_joint_channels(frame, name, ["Zrotation", "Xrotation", "Yrotation"])
        local = Rotation.from_euler("ZXY", angles, degrees=True)
        parent = PARENTS[INDEX[name]]
        if parent < 0:
            places[name] = np.array(read.frame_joint_channels(frame, name, ["Xposition", "Yposition", "Zposition"]))
            turns[name] = local
        else:
            above = JOINTS[parent]
            places[name] = places[above] + turns[above].apply(read.joint_offset(name))
            turns[name] = turns[above] * local
    ours, _ = forward_kinematics(walk.body.offsets, motion.hips, motion.rotations)
    for name, place in places.items():
        assert place == pytest.approx(ours[frame, INDEX[name]], abs=1e-5)


@pytest.mark.parametrize("kind", ["bvh", "glb"])
@pytest.mark.parametrize("path", ["line:4", "line:4,120", "circle:2,180"])
def test_every_export_walks_towards_its_own_face(kind: str, path: str) -> None:
    walk = walk_along(build_cycle(preset("normative")), parse_path(path))
    frames = even_frames(walk, 30.0).motion(walk)
    text = format_bvh(walk.body, frames)
    read = as_humanoid(parse_bvh(text)) if kind == "bvh" else parse_glb(format_glb(walk.body, frames))
    for points in foot_points(walk.body, read).values():
        ahead = points.toe_tip - points.heel
        velocity = np.gradient(points.ankle, axis=0)
        fast = np.linalg.norm(velocity, axis=1) > 0.5 * np.max(np.linalg.norm(velocity, axis=1))
        along = np.sum(ahead * velocity, axis=1)[fast] / np.linalg.norm(velocity, axis=1)[fast]
        assert np.mean(along) > 0.1


def test_uneven_frames_make_no_bvh(walk: Walk) -> None:
    with pytest.raises(ValueError, match="evenly"):
        format_bvh(walk.body, walk.motion(np.array([0.0, 0.1, 0.3])))


def test_broken_bvhs_name_the_line(walk: Walk) -> None:
    lines = format_bvh(walk.body, even_frames(walk, 24.0).motion(walk)).splitlines()
    motion = lines.index("MOTION")
    for change, named in (
        (lambda: lines[:motion], "ends too early"),
        (lambda: lines[:-1], "ends too early"),
        (lambda: ["BVH", *lines[1:]], "line 1"),
        (lambda: [*lines[: motion + 4], lines[motion + 4] + " 7", *lines[motion + 5 :]], f"line {motion + 5}"),
        (
            lambda: [*lines[: motion + 3], lines[motion + 3].replace("0.", "x.", 1), *lines[motion + 4 :]],
            f"line {motion + 4}",
        ),
        (lambda: [*lines[:3], "OFFSET 0 nan 0", *lines[4:]], "line 4"),
        (lambda: [*lines[: motion + 1], "Frames: 0", *lines[motion + 2 :]], "above 0"),
    ):
        with pytest.raises(MotionFileError) as error:
            parse_bvh("\n".join(change()))
        assert named in str(error.value)


@pytest.mark.parametrize("data", [b"", b"glTF", b"not a file at all", b"glTF" + bytes(40)])
def test_broken_glbs_are_refused(data: bytes) -> None:
    with pytest.raises(MotionFileError, match="GLB"):
        parse_glb(data)


def test_a_glb_with_bytes_changed_is_refused_or_read(walk: Walk) -> None:
    whole = format_glb(walk.body, walk.motion(walk.times(10.0)))
    random = Random(5)
    refused = 0
    for _ in range(300):
        data = bytearray(whole)
        # Its JSON is first.
        for _ in range(random.randint(1, 4)):
            data[random.randrange(12, 8000)] = random.randrange(32, 127)
        try:
            parse_glb(bytes(data))
        except MotionFileError as error:
            assert str(error).startswith("GLB: ")
            refused += 1
    assert refused > 50


def test_a_bvh_offset_has_three_numbers(walk: Walk) -> None:
    text = format_bvh(walk.body, walk.motion(np.array([0.0, 0.1])))
    more = text.replace("OFFSET 0.00000000 0.00000000 0.00000000", "OFFSET 0.0 0.0 0.0 1.0", 1)
    assert more != text
    assert parse_bvh(more).offsets.shape[1] == 3


def test_a_torn_glb_is_refused(walk: Walk) -> None:
    data = format_glb(walk.body, walk.motion(walk.times(24.0)))
    with pytest.raises(MotionFileError, match="GLB"):
        parse_glb(data[: len(data) // 2])
