"""Projects: mirror, reading and writing, operations, undo."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.errors import ProjectError, ReachError
from foottrack_service.walkcycle.inplace import in_place, points_of
from foottrack_service.walkcycle.measure import foot_points
from foottrack_service.walkcycle.operations import History, bake, copy_pose, insert_pose, shift, shift_chain
from foottrack_service.walkcycle.parameters import Parameters, with_parameters
from foottrack_service.walkcycle.presets import PRESETS, preset
from foottrack_service.walkcycle.project import (
    FootPose,
    Pose,
    format_project,
    full_cycle,
    mirrored,
    parse_project,
)
from foottrack_service.walkcycle.skeleton import POSED_JOINTS, forward_kinematics, mirrored_name

number = st.floats(-1.0, 1.0, allow_subnormal=False)
quaternion = st.tuples(number, number, number, st.floats(0.2, 1.0))
foot = st.builds(FootPose, ankle=st.tuples(number, number, number), pitch=number, yaw=number, toe=number)
pose = st.builds(
    Pose,
    hips=st.tuples(number, number, number),
    rotations=st.dictionaries(st.sampled_from(POSED_JOINTS), quaternion, max_size=6),
    left=foot,
    right=foot,
)


@given(pose)
def test_mirrored_twice_is_the_same(posed: Pose) -> None:
    assert mirrored(mirrored(posed)) == posed


@given(pose)
def test_mirroring_reflects_what_a_rotation_does(posed: Pose) -> None:
    reflect = np.array([-1.0, 1.0, 1.0])
    vector = np.array([0.3, -0.5, 0.7])
    for name, q in posed.rotations.items():
        other = mirrored(posed).rotations[mirrored_name(name)]
        assert np.allclose(rot.rotate(other, reflect * vector), reflect * rot.rotate(q, vector), atol=1e-12)


@pytest.mark.parametrize("name", PRESETS)
def test_the_second_step_mirrors_the_first(name: str) -> None:
    cycle = build_cycle(preset(name))
    phases = np.arange(0.0, 0.5, 0.05)
    first, second = in_place(cycle, phases), in_place(cycle, phases + 0.5)
    left, right = points_of(cycle.body, first, "leftHand"), points_of(cycle.body, second, "rightHand")
    # The guide is a spline through the whole walk: its ends reach the second cycle by less than a hundredth of a mm.
    assert np.allclose(left * [-1.0, 1.0, 1.0], right, atol=1e-5)


@pytest.mark.parametrize("name", PRESETS)
def test_what_is_written_is_read_back_exactly(name: str) -> None:
    project = preset(name)
    text = format_project(project)
    assert parse_project(text) == project
    assert format_project(parse_project(text)) == text


def test_reading_forgives() -> None:
    data = json.loads(format_project(preset("animator")))
    data["keys"].reverse()
    data["made_by"] = "a tool of tomorrow"
    data["keys"][0]["pose"]["rotations"]["head"] = [0, 0, 0, 2]
    project = parse_project("\ufeff" + json.dumps(data))
    assert project.keys[0].pose.rotations["head"] == (0.0, 0.0, 0.0, 1.0)
    assert build_cycle(project).stride == pytest.approx(build_cycle(preset("animator")).stride)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda d: d["keys"][1]["pose"]["left"].pop("toe"), "keys.1 (down).pose.left.toe"),
        (lambda d: d["keys"][2]["pose"]["hips"].__setitem__(1, None), "keys.2 (pass).pose.hips.1"),
        (lambda d: d["keys"][0]["pose"]["rotations"].__setitem__("leftFoot", [0, 0, 0, 1]), "leftFoot"),
        (lambda d: d["keys"][0]["pose"]["rotations"].__setitem__("tail", [0, 0, 0, 1]), "tail"),
        (lambda d: d["keys"][0]["pose"]["rotations"].__setitem__("head", [0, 0, 0, 0]), "keys.0 (contact)"),
        (lambda d: d["keys"].pop(0), "contact pose at phase 0"),
        (lambda d: d["contact"].__setitem__("heel_off", 0.01), "contact"),
        (lambda d: d.__setitem__("format", "bvh"), "format"),
    ],
)
def test_a_broken_project_names_the_place(change, named: str) -> None:  # type: ignore[no-untyped-def]
    data = json.loads(format_project(preset("animator")))
    change(data)
    with pytest.raises(ProjectError) as error:
        parse_project(json.dumps(data))
    assert named in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", '{"keys": NaN}', "\x00"])
def test_what_is_no_project_is_refused(text: str) -> None:
    with pytest.raises(ProjectError):
        parse_project(text)


def test_a_foot_out_of_the_legs_reach_names_the_pose() -> None:
    project = preset("animator")
    high = project.keys[2].pose.model_copy(update={"hips": (0.0, 1.2, 0.0)})
    keys = tuple(k if k.name != "pass" else k.model_copy(update={"pose": high}) for k in project.keys)
    with pytest.raises(ReachError, match=r"'pass'.*left ankle"):
        build_cycle(project.model_copy(update={"keys": keys}))


def test_undo_is_a_value() -> None:
    first = preset("animator")
    second = copy_pose(first, "pass", "down")
    history = History(first).done(second)
    assert history.undone().present == first
    assert history.undone().redone() == history
    assert History(first).undone() == History(first)
    assert history.undone().done(first).redone().present == first


def test_a_copied_pose_is_the_same_pose() -> None:
    project = copy_pose(preset("animator"), "pass", "down")
    assert project.key("down").pose == project.key("pass").pose
    assert project.key("down").phase == 0.125
    with pytest.raises(ProjectError, match="sideways"):
        copy_pose(project, "sideways", "down")


def test_a_baked_cycle_moves_as_the_cycle_did() -> None:
    project = shift(preset("animator"), ["leftLowerArm"], 0.04)
    baked = bake(project, 48)
    assert len(baked.keys) == 48
    assert not baked.offsets
    phases = np.arange(48) / 48.0
    before, after = build_cycle(project), build_cycle(baked)
    for joint in ("leftHand", "rightFoot", "head"):
        one, two = (points_of(c.body, in_place(c, phases), joint) for c in (before, after))
        apart = np.linalg.norm(one - np.mean(one, axis=0) - two + np.mean(two, axis=0), axis=1)
        # The feet's keys next to a toe-off give way to it.
        assert np.max(apart) < (0.02 if joint == "rightFoot" else 0.01), joint


def test_an_in_between_changes_nothing_but_adds_a_key() -> None:
    project = preset("animator")
    more = insert_pose(project, "late pass", 0.3125)
    assert [key.name for key in more.keys] == ["contact", "down", "pass", "late pass", "up"]
    one, two = build_cycle(project), build_cycle(more)
    assert one.stride == pytest.approx(two.stride)


def test_a_shifted_joint_comes_later() -> None:
    project = preset("animator")
    shifted = shift(project, ["leftUpperArm"], 0.1)
    assert shifted.offsets == {"leftUpperArm": 0.1, "rightUpperArm": 0.1}
    before, after = build_cycle(project), build_cycle(shifted)
    phases = np.linspace(0.0, 1.0, 7)
    assert np.allclose(after.joints["leftUpperArm"](phases), before.joints["leftUpperArm"](phases - 0.1))
    with pytest.raises(ProjectError, match="leftFoot"):
        shift(project, ["leftFoot"], 0.1)


def test_a_chain_drags_link_by_link() -> None:
    chain = ["leftShoulder", "leftUpperArm", "leftLowerArm"]
    offsets = shift_chain(preset("animator"), chain, 0.03).offsets
    assert [offsets.get(name, 0.0) for name in chain] == pytest.approx([0.0, 0.03, 0.06])


def test_the_full_cycle_has_both_steps() -> None:
    project = full_cycle(preset("animator"))
    assert [key.phase for key in project.keys] == [0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875]
    assert project.keys[4].pose == mirrored(project.keys[0].pose)
    assert full_cycle(project) is project


@pytest.mark.parametrize("name", PRESETS)
def test_parameters_do_what_they_say(name: str) -> None:
    wanted = Parameters(step_length=0.5, bounce=0.03, sway=0.05, toe_out=9.0, frames=30.0)
    project = with_parameters(preset(name), wanted)
    cycle = build_cycle(project)
    heights = [key.pose.hips[1] for key in project.keys]
    assert cycle.step == pytest.approx(0.5, abs=1e-9)
    assert max(heights) - min(heights) == pytest.approx(0.03)
    assert 2.0 * max(abs(key.pose.hips[0]) for key in project.keys) == pytest.approx(0.05)
    assert project.period == pytest.approx(1.25)
    points = foot_points(cycle.body, in_place(cycle, [0.25]))
    assert np.degrees(points["left"].yaw[0]) == pytest.approx(9.0, abs=1e-6)


def test_speed_keeps_the_walk_ratio() -> None:
    slow, fast = (build_cycle(with_parameters(preset("normative"), Parameters(speed=v))) for v in (0.8, 1.6))
    assert fast.speed == pytest.approx(1.6)
    assert fast.step / slow.step == pytest.approx(np.sqrt(2.0))
    assert fast.step * fast.period == pytest.approx(slow.step * slow.period)


def test_step_height_lifts_the_foot() -> None:
    low, high = (
        np.max(foot_points(c.body, in_place(c, np.arange(0, 1, 0.01)))["left"].ankle[:, 1])
        for c in (build_cycle(with_parameters(preset("sneak"), Parameters(step_height=h))) for h in (0.2, 0.3))
    )
    assert high - low == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize(
    "bad", [{"speed": 0.0}, {"step_length": 3.0}, {"frames": 24.0, "speed": 1.0}, {"bounce": float("nan")}]
)
def test_parameters_out_of_range_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ProjectError):
        with_parameters(preset("normative"), Parameters(**bad))


def test_rest_pose_stands_on_its_feet() -> None:
    cycle = build_cycle(preset("normative"))
    body = cycle.body
    rotations = np.tile(rot.IDENTITY, (1, 22, 1))
    places, _ = forward_kinematics(body.offsets, body.offsets[:1], rotations)
    assert places[0, 16, 1] == pytest.approx(body.ankle_height)
    assert (places[0, 17] + body.toe_tip)[1] == pytest.approx(0.0)
