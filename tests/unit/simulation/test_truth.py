"""The truth is smooth, keeps its feet on the floor and its legs on."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.config import BodySettings, FeetSettings, FootSettings, Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation.anatomy import Sole, knees, person
from foottrack_service.simulation.anatomy import sole as sole_from
from foottrack_service.simulation.footsteps import Place, Step, Style, stepping
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.rocker import rocker
from foottrack_service.simulation.stairs import RISE
from foottrack_service.simulation.stride import CAUTIOUS, IN_PLACE
from foottrack_service.simulation.tasks import TASKS
from foottrack_service.simulation.truth import BOTH, FootTrack, Track, Truth, grid
from foottrack_service.walkcycle.skeleton import Humanoid

SECONDS = 12.0
STRIDING = Style(
    swing=0.44, roll=0.28, settle=0.09, toe_off_pitch=0.95, toe_off_rate=4.0, strike_pitch=-0.35, lift=0.05
)
STYLES = {"striding": STRIDING, "cautious": CAUTIOUS, "in place": IN_PLACE}
WALKS = ["circle", "line", "s-curve", "walk"]
PEOPLE = sorted(set(TASKS) - {"still", "tracker-moving", "head-bench", "sudden-move"})


@cache
def made(task: str, feet: Feet = "mild", seed: int = 3) -> Truth:
    return TASKS[task].truth(SECONDS, Settings(), feet, np.random.default_rng(seed))


def sole_of(side: Side) -> Sole:
    return sole_from(Settings().feet.of(side))


def instants(hz: float = 200.0) -> Array:
    return np.asarray(np.arange(0.0, SECONDS, 1.0 / hz))


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("feet", ["mild", "hard"])
def test_derivatives_are_those_of_the_pose(task: str, feet: Feet) -> None:
    truth, t, h = made(task, feet), instants(), 1e-4
    for track in (truth.head, *truth.feet.values()):
        here = track.kinematics(t)
        before, after = track.kinematics(t - h), track.kinematics(t + h)
        np.testing.assert_allclose(here.v, (after.p - before.p) / (2 * h), atol=2e-4)
        np.testing.assert_allclose(here.a, (after.v - before.v) / (2 * h), atol=0.05)
        turned = rotations.multiply(rotations.conjugate(before.q), after.q)
        np.testing.assert_allclose(here.w, rotations.to_rotation_vector(turned) / (2 * h), atol=2e-4)
        np.testing.assert_allclose(here.dw, (after.w - before.w) / (2 * h), atol=0.05)
        p, q = track.pose(t)
        np.testing.assert_array_equal(p, here.p)
        np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-12)


def test_spinning_and_circling_have_the_textbook_derivatives() -> None:
    t = grid(2.0)
    p = np.stack([2.0 * np.cos(3.0 * t), np.zeros_like(t), 2.0 * np.sin(3.0 * t)], axis=-1)
    track = Track(t, p, rotations.from_yaw(3.0 * t))
    some = np.linspace(0.0, 2.0, 50)
    here = track.kinematics(some)
    np.testing.assert_allclose(here.a, -9.0 * here.p, atol=1e-5)
    np.testing.assert_allclose(here.w, np.tile([0.0, 3.0, 0.0], (50, 1)), atol=1e-8)
    np.testing.assert_allclose(here.dw, 0.0, atol=1e-4)


@pytest.mark.parametrize("task", WALKS)
@pytest.mark.parametrize("feet", BOTH)
def test_who_walks_somewhere_stands_on_the_heel_and_on_the_toes_joint(task: str, feet: Side) -> None:
    """The joint is above the sole's ball, and stays where the foot stood flat while the heel rises."""
    foot, t = made(task).feet[feet], instants(500.0)
    t = t[t < 6.0]  # then the one who walks a line turns round
    heel, toe = foot.contact(t)
    joint = foot.ball_point + [0.0, Humanoid().ball_height, 0.0]
    for stands, r in ((heel, foot.heel_point), (toe, joint)):
        bouts = np.flatnonzero(np.diff(stands.astype(int)))
        assert len(bouts) >= 4
        for first, last in zip(bouts[:-1] + 2, bouts[1:] - 1, strict=True):
            if stands[first]:
                held = foot.point(t[first:last], r)
                # The truth's own spline rounds the corners of landing and leaving by this much.
                assert np.ptp(held, axis=0).max() < 5e-5
                assert held[:, 1] == pytest.approx(r[1] + Settings().feet.of(feet).ankle_height, abs=5e-5)


@pytest.mark.parametrize("task", [task for task in PEOPLE if task not in WALKS])
@pytest.mark.parametrize("side", BOTH)
def test_what_stands_does_not_slip(task: str, side: Side) -> None:
    foot, toes, t = made(task).feet[side], rocker(sole_of(side)), instants(500.0)
    heel, toe = foot.contact(t)
    here = foot.kinematics(t)
    pitch = -np.arcsin(rotations.rotate(here.q, [0.0, 0.0, -1.0])[:, 1])
    ahead, below = toes.contact(np.asarray(pitch))
    rolled = np.stack([np.zeros_like(t), -below, -ahead], axis=-1)
    for stands, r in ((heel, np.tile(foot.heel_point, (len(t), 1))), (toe, rolled)):
        # Right beside a change of state it moves a little already: the spline rounds the corner.
        inner = stands & np.roll(stands, 1) & np.roll(stands, -1)
        speed = np.linalg.norm(here.v + rotations.rotate(here.q, np.cross(here.w, r)), axis=-1)
        assert inner.any()
        assert speed[inner].max() < 5e-3
        floor = RISE if task == "stairs" else np.inf
        height = (here.p + rotations.rotate(here.q, r))[inner, 1]
        assert np.abs(np.remainder(height + 0.5 * RISE, floor) - 0.5 * RISE).max() < 1e-4


@pytest.mark.parametrize("task", PEOPLE)
@pytest.mark.parametrize("side", BOTH)
def test_shoes_stay_above_the_floor(task: str, side: Side) -> None:
    foot = made(task).feet[side]
    # Toes that bend stay on the floor; the rigid foot's go through it.
    toes = [] if task in WALKS else [Settings().feet.of(side).toe.p]
    for point in (foot.heel_point, foot.ball_point, *toes):
        assert foot.point(instants(), point)[:, 1].min() > -5e-4


@pytest.mark.parametrize("task", PEOPLE)
@pytest.mark.parametrize("height", [1.5, 1.75, 2.0])
def test_legs_reach(task: str, height: float) -> None:
    settings = Settings(body=BodySettings(height=height))
    truth = TASKS[task].truth(SECONDS, settings, "mild", np.random.default_rng(3))
    wearer, t = person(settings.body, settings.feet.left.ankle_height), instants()
    assert truth.hips is not None
    p, q = truth.hips.pose(t)
    for side, lateral in zip(BOTH, (-0.5, 0.5), strict=True):
        hip = p + rotations.rotate(q, [lateral * wearer.hip_spacing, 0.0, 0.0])
        length = np.linalg.norm(hip - truth.feet[side].pose(t)[0], axis=-1)
        assert length.max() < wearer.leg * 1.005
        assert length.min() > 0.45 * wearer.leg
    head = truth.head.pose(t)[0]
    assert np.linalg.norm(head - p, axis=-1).max() < wearer.neck_above_hips + 0.16


def test_hard_feet_strike_hard_and_give_way_a_little() -> None:
    t = instants(2000.0)
    mild, hard = made("walk").left, made("walk", "hard").left
    strikes = hard.strikes[(hard.strikes > 0.1) & (hard.strikes < SECONDS - 0.1)]
    assert len(strikes) > 5
    force = np.linalg.norm(hard.kinematics(t).a, axis=-1)
    peaks = [force[(t > s) & (t < s + 0.03)].max() for s in strikes]
    assert 40.0 < np.median(peaks) < 115.0
    # Real feet on the way (gaitmap's recording, without the impacts): 38 at toe-off, 58 before the strike at p95.
    assert np.linalg.norm(mild.kinematics(t).a, axis=-1).max() < 55.0
    assert np.linalg.norm(hard.pose(t)[0] - mild.pose(t)[0], axis=-1).max() < 0.012


@pytest.mark.parametrize("task", TASKS)
def test_specific_force_is_continuous(task: str) -> None:
    for foot in made(task).feet.values():
        a = foot.kinematics(instants(4000.0)).a
        # Half a millisecond apart; a jump would be m/s^2 however fine the grid is.
        assert np.linalg.norm(np.diff(a, axis=0), axis=-1).max() < 1.5


def test_a_walk_rolls_from_heel_to_toe_at_a_walking_pace() -> None:
    truth = made("walk")
    foot, t = truth.left, instants()
    heel, toe = foot.contact(t)
    assert (toe & ~heel).mean() > 0.1
    assert (heel & ~toe).mean() > 0.02
    pitch = rotations.rotate(foot.pose(t)[1], [0.0, 0.0, -1.0])[:, 1]
    assert pitch[toe & ~heel].min() < -np.sin(np.radians(35.0)), "the heel rises"
    assert pitch[heel & ~toe].max() > np.sin(np.radians(15.0)), "the heel lands first"
    assert 3.5 < np.linalg.norm(foot.velocity(t), axis=-1).max() < 5.5
    strides = np.diff(foot.strikes[1:5])
    np.testing.assert_allclose(strides, 1.10, atol=0.12)
    walked = foot.point(foot.strikes[1:5] + 0.2, [0.0, 0.0, 0.0])
    np.testing.assert_allclose(np.linalg.norm(np.diff(walked, axis=0), axis=-1), 1.40, atol=0.1)


def test_tasks_go_where_they_say() -> None:
    def span(task: str) -> Array:
        p = (
            TASKS[task]
            .truth(30.0, Settings(), "mild", np.random.default_rng(1))
            .left.pose(np.arange(0.0, 30.0, 0.02))[0]
        )
        return np.asarray(p.max(axis=0) - p.min(axis=0))

    assert 2.0 < span("line")[2] < 2.5
    assert 1.8 < span("circle")[2] < 2.4
    assert 0.4 < span("steps")[2] < 0.8
    assert span("steps")[0] < 0.3 < span("side-steps")[0]
    assert 0.1 < span("walk-in-place")[1] < 0.3
    assert span("walk-in-place")[2] < 0.2
    assert np.all(span("upper-body") < 1e-6)


def test_another_body_walks_at_its_own_scale_on_its_own_soles() -> None:
    """Froude: half the extra of the leg in time. The soles are as the settings say, on either side."""
    feet = FeetSettings(left=FootSettings(ankle_height=0.11), right=FootSettings(ankle_height=0.06))
    settings = Settings(body=BodySettings(height=1.5), feet=feet)
    truth = TASKS["walk"].truth(SECONDS, settings, "mild", np.random.default_rng(3))
    legs = [person(BodySettings(height=height), 0.09).leg for height in (1.5, 1.75)]
    small, usual = (float(np.median(np.diff(foot.strikes))) for foot in (truth.left, made("walk").left))
    assert small / usual == pytest.approx(np.sqrt(legs[0] / legs[1]), abs=0.03)
    for side, height in (("left", 0.11), ("right", 0.06)):
        foot = truth.feet[side]
        heel, toe = foot.contact(instants())
        flat = foot.pose(instants()[heel & toe])[0][:, 1]
        assert np.abs(flat - height).max() < 1e-3
        assert foot.point(instants(), foot.heel_point)[:, 1].min() > -5e-4


def test_a_step_cannot_begin_before_the_last_one_ended() -> None:
    steps = [Step(1.0, Place(0.0, -0.5, 0.0), CAUTIOUS), Step(1.7, Place(0.0, -1.0, 0.0), CAUTIOUS)]
    with pytest.raises(ValueError, match="before the foot is flat"):
        stepping(grid(4.0), Place(0.0, 0.0, 0.0), steps, sole_of("left"))


@pytest.mark.parametrize("style", STYLES)
def test_one_step_rolls_over_the_toes_and_lands_on_the_heel(style: str) -> None:
    sole = sole_of("left")
    t = grid(3.0)
    step = Step(1.0, Place(0.1, -0.6, 0.3), STYLES[style])
    foot = stepping(t, Place(0.0, 0.0, 0.0), [step], sole)
    track = FootTrack(t, foot.p, foot.q, heel=foot.heel, toe=foot.toe, heel_point=sole.heel, ball_point=sole.ball)
    rolling = track.point(np.linspace(step.heel_off, step.start, 20)[:-1], sole.ball)
    np.testing.assert_allclose(rolling[0], [0.0, 0.0, -sole.ball_z], atol=1e-5)
    assert np.all(np.diff(rolling[:, 1]) > -1e-6), "the ball leaves the floor as the foot rolls on to the toes"
    if STYLES[style] is STRIDING:
        tip = track.point(np.array([step.start]), [0.0, -sole.toe_height, -sole.toe_z])[0]
        assert tip[1] == pytest.approx(0.0, abs=1e-3)
        assert -tip[2] == pytest.approx(sole.toe_z, abs=0.004), "rolled without slipping, so it is where it was, flat"
    landing = np.linspace(step.strike, step.flat, 20)[1:]
    heel = [0.1 + sole.heel_z * np.sin(0.3), 0.0, -0.6 + sole.heel_z * np.cos(0.3)]
    np.testing.assert_allclose(track.point(landing, sole.heel), np.tile(heel, (19, 1)), atol=1e-5)


def test_knees_keep_the_bones_lengths() -> None:
    wearer = person(BodySettings(), 0.09)
    hip, ankle = np.array([[0.0, 0.9, 0.0]]), np.array([[0.05, 0.15, -0.2]])
    knee = knees(hip, ankle, np.array([[0.0, 0.0, -1.0]]), wearer)
    assert np.linalg.norm(knee - hip) == pytest.approx(wearer.thigh)
    assert np.linalg.norm(knee - ankle) == pytest.approx(wearer.shank)
    assert knee[0, 2] < -0.1
