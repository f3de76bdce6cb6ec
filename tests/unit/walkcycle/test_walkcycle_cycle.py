"""What a cycle looks like: its arcs, its angles, its bounce; and Lee's own method beside ours."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks

from foottrack_service.walkcycle.curves import at_rest
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.errors import ProjectError
from foottrack_service.walkcycle.inplace import arc, in_place, self_crossings
from foottrack_service.walkcycle.measure import foot_points
from foottrack_service.walkcycle.normative import ANGLES, normative_mean, normative_sd
from foottrack_service.walkcycle.presets import PRESETS, preset
from foottrack_service.walkcycle.reference import (
    compensated_step,
    heading_keys,
    interpolated_heading,
    step_offsets_as_meant,
    step_offsets_as_printed,
)
from foottrack_service.walkcycle.report import angle_rms, cycle_closure
from foottrack_service.walkcycle.skeleton import INDEX, Humanoid, Measures, forward_kinematics


@pytest.mark.parametrize("name", PRESETS)
def test_a_cycle_closes(name: str) -> None:
    assert cycle_closure(build_cycle(preset(name))) < 1e-6


def test_normative_angles_are_those_published() -> None:
    cycle = build_cycle(preset("normative"))
    assert cycle.stride == pytest.approx(1.40, abs=0.02)
    assert cycle.period == 1.10
    assert cycle.project.contact.toe_off == 0.60
    rms = angle_rms(cycle)
    assert set(rms) == set(ANGLES)
    assert max(rms.values()) < 8.0


@pytest.mark.parametrize(
    ("angle", "phase", "published"),
    [
        ("hip", 0.0, 36),
        ("knee", 0.0, 6),
        ("ankle", 0.0, -2),
        ("hip", 0.5, -5),
        ("knee", 0.72, 59),
        ("ankle", 0.64, -20),
    ],
)
def test_the_published_mean(angle: str, phase: float, published: float) -> None:
    assert float(normative_mean(angle, phase)) == pytest.approx(published, abs=0.7)
    assert 3.0 < float(normative_sd(angle, phase)) < 10.0


@pytest.mark.parametrize("name", PRESETS)
def test_heels_draw_figures_of_eight_from_above(name: str) -> None:
    for side in ("left", "right"):
        assert self_crossings(arc(build_cycle(preset(name)), f"{side}Heel").points[:, [2, 0]]) == 1


@pytest.mark.parametrize("name", PRESETS)
def test_wrists_draw_figures_of_eight_from_the_side(name: str) -> None:
    for side in ("left", "right"):
        assert self_crossings(arc(build_cycle(preset(name)), f"{side}Hand").points[:, [2, 1]]) == 1


def test_the_normative_arms_swing_as_published() -> None:
    """Murray 1967: the shoulder 24 deg back at its own side's strike, 8 ahead at the other's; the elbow 17 to 47."""
    cycle = build_cycle(preset("normative"))
    motion = in_place(cycle, np.arange(0.0, 1.0, 0.02))
    places, _ = forward_kinematics(cycle.body.offsets, motion.hips, motion.rotations)
    shoulder, elbow, wrist = (places[:, INDEX[f"left{part}"]][:, 1:] for part in ("UpperArm", "LowerArm", "Hand"))
    upper, lower = elbow - shoulder, wrist - elbow
    swing = np.degrees(np.arctan2(upper[:, 1], -upper[:, 0]))
    bend = np.degrees(np.arctan2(lower[:, 1], -lower[:, 0])) - swing
    assert swing[0] == pytest.approx(-24.0, abs=4.0)
    assert swing[25] == pytest.approx(8.0, abs=4.0)
    assert (bend.min(), bend.max()) == (pytest.approx(17.0, abs=4.0), pytest.approx(47.0, abs=4.0))


def test_crossings_of_known_curves() -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False) + 0.01
    assert self_crossings(np.stack([np.cos(t), np.sin(t)], axis=-1)) == 0
    assert self_crossings(np.stack([np.cos(t), np.sin(2 * t)], axis=-1)) == 1


def test_an_arc_carries_the_marks_of_its_keys() -> None:
    cycle = build_cycle(preset("animator"))
    found = arc(cycle, "leftHand", samples=160)
    assert found.names[:4] == ("contact", "down", "pass", "up")
    assert np.allclose(found.marks, found.points[::20], atol=1e-9)
    with pytest.raises(ProjectError, match="nose"):
        arc(cycle, "nose")


def test_the_animators_up_is_his_highest_and_not_peoples() -> None:
    phases = np.arange(0.0, 0.5, 0.01)
    animator = in_place(build_cycle(preset("animator")), phases).hips[:, 1]
    people = in_place(build_cycle(preset("normative")), phases).hips[:, 1]
    assert 0.33 < phases[np.argmax(animator)] < 0.45
    assert 0.24 < phases[np.argmax(people)] < 0.35


def test_double_bounce_bounces_twice_a_step() -> None:
    def peaks(name: str) -> int:
        y = in_place(build_cycle(preset(name)), np.arange(0.0, 1.0, 0.01)).hips[:, 1]
        return len(find_peaks(np.roll(y, -int(np.argmin(y))), prominence=0.005)[0])

    assert peaks("double-bounce") == 4
    assert peaks("animator") == 2


def test_sneaking_lands_on_the_toes() -> None:
    cycle = build_cycle(preset("sneak"))
    points = foot_points(cycle.body, in_place(cycle, [0.0]))["left"]
    assert points.heel[0, 1] > 0.02
    assert points.ball[0, 1] == pytest.approx(cycle.body.ball_height, abs=1e-9)


@pytest.mark.parametrize("between", [2, 3, 6, 11])
def test_a_curve_at_rest_leaves_and_arrives_gently_and_passes_its_keys(between: int) -> None:
    phases = np.linspace(0.6, 1.0, between + 2)
    values = 0.5 - 0.5 * np.cos((phases - 0.6) / 0.4 * np.pi)
    curve = at_rest(phases, values)
    assert curve(phases) == pytest.approx(values, abs=5e-3)
    assert curve(np.array([0.0, 2.0])) == pytest.approx([0.0, 1.0])
    h = 1e-4
    for end, inwards in ((0.6, 1.0), (1.0, -1.0)):
        first, second, third = curve(end + inwards * h * np.arange(3.0))
        assert abs(second - first) / h < 1e-3
        assert abs(third - 2.0 * second + first) / h**2 < 1.0
    steps = np.diff(curve(np.linspace(0.6, 1.0, 400)))
    assert steps.min() > -1e-6, "it overshoots nowhere"


def test_a_body_with_measures_of_its_own_stands_on_its_own_feet() -> None:
    known = Measures(
        thigh=0.5, shank=0.4, hip_width=0.2, torso=0.6, ankle_height=0.11, heel_behind=0.06, ball_ahead=0.15
    )
    body = Humanoid(1.8, known)
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (1, 22, 1))
    places, _ = forward_kinematics(body.offsets, body.offsets[:1], rest)
    at = {name: places[0, index] for name, index in INDEX.items()}
    assert at["hips"] == pytest.approx([0.0, 1.01, 0.0])
    assert at["head"][1] == pytest.approx(1.61)
    assert at["leftFoot"] == pytest.approx([0.1, 0.11, 0.0])
    assert at["rightFoot"] == pytest.approx([-0.1, 0.11, 0.0])
    assert at["leftToes"] == pytest.approx([0.1, body.ball_height, 0.15])
    assert body.heel == pytest.approx([0.0, -0.11, -0.06])
    # In proportion, nothing changes.
    alike = Humanoid(1.8)
    same = Measures(alike.thigh, alike.shank, ankle_height=alike.ankle_height, ball_ahead=float(alike.ball[2]))
    assert Humanoid(1.8, same).offsets == pytest.approx(alike.offsets)


def test_heels_rise_and_toes_roll() -> None:
    cycle = build_cycle(preset("normative"))
    points = foot_points(cycle.body, in_place(cycle, [0.0, 0.2, 0.55]))["left"]
    assert points.heel[:, 1] == pytest.approx([0.0, 0.0, points.heel[2, 1]], abs=1e-9)
    assert points.heel[2, 1] > 0.04
    assert points.toe_tip[0, 1] > 0.03
    assert points.toe_tip[1:, 1] == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("name", PRESETS)
def test_lees_compensation_holds_one_foot_and_lets_the_other_slip(name: str) -> None:
    project = preset(name)
    step = compensated_step(project, 120)
    feet = foot_points(Humanoid(project.height), step)
    assert np.ptp(feet["left"].heel[:61, 2]) < 1e-9
    assert np.ptp(feet["left"].ball[60:, 2]) < 1e-9
    double_support = int(240 * (project.contact.toe_off - 0.5))
    assert 0.02 < np.ptp(feet["right"].ball[: double_support + 1, 2]) < 0.15


def test_lees_printed_loop_doubles_its_offset() -> None:
    assert step_offsets_as_printed(1.0, 4).tolist() == [1.0, 2.0, 4.0, 8.0]
    assert step_offsets_as_meant(1.0, 4).tolist() == [1.0, 2.0, 3.0, 4.0]


def test_lees_curve_rule_turns_between_the_middles_of_steps() -> None:
    keys = heading_keys([(0, 0), (0, 1), (1, 1)], 12)
    assert keys == [(0, 0.0), (6, 0.0), (18, pytest.approx(np.pi / 2)), (24, pytest.approx(np.pi / 2))]
    yaw = interpolated_heading(keys, np.arange(25))
    assert np.all(yaw[:7] == 0.0)
    assert yaw[12] == pytest.approx(np.pi / 4)
    assert np.allclose(yaw[18:], np.pi / 2)
