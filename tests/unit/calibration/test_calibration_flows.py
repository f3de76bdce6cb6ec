"""Calibrations of simulated people: what is found, what is refused, and what the person is told."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from calibration_people import (
    LOOKING_AHEAD,
    LOOKING_DOWN,
    SECOND,
    raised,
    scenario,
    standing,
    stepping,
    watch,
)

from foottrack_protocol.control import Code
from foottrack_protocol.messages import MountValues
from foottrack_service import rotations as rot
from foottrack_service.calibration.body import NOD_S, BodyFlow
from foottrack_service.calibration.floor import FloorFlow
from foottrack_service.calibration.flow import Refused
from foottrack_service.calibration.heading import HeadingFlow
from foottrack_service.calibration.mount import MountFlow
from foottrack_service.config import BodySettings, CameraSettings, FeetSettings, FootSettings, Placement, Settings
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.offline import fuse
from foottrack_service.simulation.posture import Bearing

RESTLESS = Bearing(gaze_sd=math.radians(10.0), gaze_band_hz=1.5, sway_sd=0.05, sway_band_hz=1.5)
LOOKING_AROUND = Bearing(gaze_sd=math.radians(14.0), gaze_band_hz=0.5, sway_sd=0.06, sway_band_hz=0.4)


def person(height: float) -> Settings:
    return Settings(body=BodySettings(height=height))


def refused(flow, messages, until_s=60.0) -> Refused:
    with pytest.raises(Refused) as error:
        watch(flow, messages, until_s)
    return error.value


def repeated(messages, seconds: float, times: int):
    """The same again and again, so that a short simulation lasts."""
    listed = list(messages)
    for number in range(times):
        shift = round(number * seconds * SECOND)
        for arrival, message in listed:
            yield arrival + shift, message._replace(t=message.t + shift)


@pytest.mark.parametrize("height", [1.62, 1.90])
@pytest.mark.parametrize("floor", [0.0, 0.03])
def test_the_floor_is_under_the_soles_of_a_person_who_stands(monkeypatch, height, floor) -> None:
    """The tags' range is off by up to 1 % of 1.5 m in each simulated camera: mean over some."""
    found = []
    for seed in range(4):
        flow = FloorFlow(person(height))
        run = scenario(monkeypatch, standing(LOOKING_DOWN), person(height), seconds=4.0, seed=seed)
        told = watch(flow, raised(run.messages(), floor))
        assert told[0].startswith("Stand still")
        found.append(flow.found.values.height)
        assert flow.progress.share == 1.0
    assert np.abs(np.array(found) - floor).max() < 0.02
    assert np.mean(found) == pytest.approx(floor, abs=0.008)


def test_the_floor_uses_the_mount_s_correction_only_of_the_mount_that_is_configured(monkeypatch) -> None:
    settings = person(1.75)
    run = scenario(monkeypatch, standing(LOOKING_DOWN), settings, seconds=4.0)
    heights = []
    for base in (settings.camera.mount_hash, "another"):
        mount = MountValues(p=(0.0, 0.0, -0.02), q=(0.0, 0.0, 0.0, 1.0), sigma_p=1e-3, sigma_q=1e-3, base=base)
        flow = FloorFlow(settings, mount)
        watch(flow, run.messages())
        heights.append(flow.found.values.height)
    # The head looks 60 deg down: 20 mm along its view are 17 mm downwards.
    assert heights[0] - heights[1] == pytest.approx(-0.02 * math.sin(math.radians(60.0)), abs=1e-3)


def test_who_does_not_stand_still_gets_no_floor(monkeypatch) -> None:
    run = scenario(monkeypatch, standing(RESTLESS), person(1.75), seconds=10.0)
    error = refused(FloorFlow(person(1.75)), repeated(run.messages(), 10.0, 5))
    assert error.code is Code.NOT_STILL
    assert "mm" in error.message


def test_without_a_headset_calibrations_are_unavailable() -> None:
    for flow in (FloorFlow(Settings()), BodyFlow(Settings()), HeadingFlow(Settings()), MountFlow(Settings())):
        error = refused(flow, [])
        assert (error.code, "headset" in error.message) == (Code.UNAVAILABLE, True)


def test_without_a_camera_the_floor_is_unavailable_and_says_so(monkeypatch) -> None:
    run = scenario(monkeypatch, standing(LOOKING_DOWN), person(1.75), seconds=10.0, camera=False)
    for flow in (FloorFlow(person(1.75)), MountFlow(person(1.75))):
        error = refused(flow, repeated(run.messages(), 10.0, 6))
        assert (error.code, "tag" in error.message) == (Code.UNAVAILABLE, True)


def test_a_foot_on_a_step_is_no_floor(monkeypatch) -> None:
    settings = person(1.75)
    run = scenario(monkeypatch, standing(LOOKING_DOWN), settings, seconds=10.0)
    # A marker 8 cm higher on its shoe than the settings say looks the same.
    wrong = FootSettings(marker=Placement(p=(0.0, -0.12, -0.15)))
    flow = FloorFlow(Settings(feet=FeetSettings(left=wrong)))
    error = refused(flow, repeated(run.messages(), 10.0, 6))
    assert (error.code, "sole" in error.message) == (Code.FAILED, True)


@pytest.mark.parametrize("height", [1.62, 1.90])
@pytest.mark.parametrize("known", [True, False])
def test_the_body_of_a_person_who_stands_upright(monkeypatch, height, known) -> None:
    run = scenario(monkeypatch, standing(LOOKING_AHEAD), person(height), seconds=11.0)
    flow = BodyFlow(Settings(), height if known else None, floor=0.03)
    told = watch(flow, raised(run.messages(), 0.03))
    values = flow.found.values
    assert values.height == pytest.approx(height, abs=1e-9 if known else 0.015)
    assert values.thigh + values.shank == pytest.approx(0.491 * height, abs=0.01)
    assert values.torso == pytest.approx(0.936 * height - 0.09 - 0.99 * 0.491 * height, abs=0.015)
    assert "Good. Stay like that." in told


def test_it_takes_three_seconds_of_standing_and_waits_a_little_for_a_nod(monkeypatch) -> None:
    run = scenario(monkeypatch, standing(LOOKING_AHEAD), person(1.75), seconds=12.0)
    flow, asked = BodyFlow(person(1.75)), None
    flow.begin(0)
    for arrival, message in run.messages():
        flow.take(message, arrival)
        if asked is None and flow.progress.text.startswith("Now look down"):
            asked = arrival / SECOND
        if flow.found is not None:
            assert asked is not None and 3.0 < asked < 4.0
            assert asked + NOD_S <= arrival / SECOND < asked + NOD_S + 0.2
            return
    pytest.fail("nothing was found")


def test_who_stood_just_in_time_has_measures(monkeypatch) -> None:
    run = scenario(monkeypatch, standing(LOOKING_AHEAD), person(1.75), seconds=5.0)
    flow = BodyFlow(person(1.75))
    watch(flow, run.messages(), until_s=60.0)
    assert flow.found.values.height == pytest.approx(1.75, abs=0.015)


def test_the_hips_are_where_the_feet_say(monkeypatch) -> None:
    """Someone who looks 20 deg down, so that the camera sees the feet; fused by the service's own core."""
    settings = person(1.75)
    bearing = replace(LOOKING_DOWN, look_down=math.radians(24.0))
    flow = BodyFlow(settings)
    run = scenario(monkeypatch, standing(bearing), settings, seconds=11.0)
    flow.begin(0)
    core = FusionCore(settings)
    messages = list(run.messages())
    both = sorted(
        [(arrival, message) for arrival, message in messages if message.stream == "head/pose"]
        + [(result.t_pub, result) for result in fuse(messages, core) if result.stream == "pose/body"],
        key=lambda item: item[0],
    )
    watch(flow, both)
    # The simulated person's hips are under the neck, which is 90 mm behind the eyes.
    assert flow.found.values.hip_back == pytest.approx(0.09, abs=0.03)


def test_a_height_that_cannot_be_is_refused_with_what_was_measured(monkeypatch) -> None:
    run = scenario(monkeypatch, standing(LOOKING_AHEAD), person(1.62), seconds=6.0)
    error = refused(BodyFlow(Settings(), height=1.85), run.messages())
    assert (error.code, "1.85 m" in error.message) == (Code.FAILED, True)
    error = refused(BodyFlow(Settings(), floor=1.2), run.messages())
    assert (error.code, "floor first" in error.message) == (Code.FAILED, True)


@pytest.mark.parametrize(("bearing", "word"), [(RESTLESS, "mov"), (LOOKING_DOWN, "level")])
def test_who_moves_or_looks_down_has_no_measures(monkeypatch, bearing, word) -> None:
    bearing = bearing if bearing is LOOKING_DOWN else replace(bearing, look_down=0.1, gaze_sd=0.05)
    run = scenario(monkeypatch, standing(bearing), person(1.75), seconds=10.0)
    error = refused(BodyFlow(Settings()), repeated(run.messages(), 10.0, 5))
    assert (error.code, word in error.message) == (Code.NOT_STILL, True)


def true_yaw(run, settings, side) -> float:
    """Of the device's frame in the stage, while the foot stands at the beginning."""
    message = next(m for _, m in run.messages() if m.stream == f"imu/{side}" and m.t > SECOND)
    q = run.truth.feet[side].pose(np.array([message.t * 1e-9]))[1][0]
    sensor = rot.multiply(q, settings.feet.of(side).imu.q)
    return float(rot.yaw_of(rot.multiply(sensor, rot.conjugate(message.data.q))))


@pytest.mark.parametrize("seed", range(4))
def test_forward_and_the_imus_yaw_from_a_look_and_a_step(monkeypatch, seed) -> None:
    settings = person(1.75)
    run = scenario(monkeypatch, stepping(LOOKING_AHEAD), settings, seed=seed)
    flow = HeadingFlow(settings)
    told = watch(flow, run.messages())
    assert told[1].startswith("Now take one step")
    values = flow.found.values
    assert math.degrees(abs(values.yaw)) < 2.0
    for side in ("left", "right"):
        off = math.remainder(getattr(values.imu_yaw, side) - true_yaw(run, settings, side), 2.0 * math.pi)
        assert math.degrees(abs(off)) < 5.0


def test_an_imu_without_an_attitude_of_its_own_has_no_yaw_and_forward_is_found(monkeypatch) -> None:
    run = scenario(monkeypatch, stepping(LOOKING_AHEAD), person(1.75), imu="raw")
    flow = HeadingFlow(person(1.75))
    watch(flow, run.messages())
    assert (flow.found.values.imu_yaw.left, flow.found.values.imu_yaw.right) == (None, None)


def test_a_step_aside_is_not_forward(monkeypatch) -> None:
    run = scenario(monkeypatch, stepping(LOOKING_AHEAD, aside=0.45), person(1.75))
    error = refused(HeadingFlow(person(1.75)), run.messages())
    assert (error.code, "to the right" in error.message) == (Code.FAILED, True)


def test_an_imu_that_sits_otherwise_than_configured_is_noticed(monkeypatch) -> None:
    run = scenario(monkeypatch, stepping(LOOKING_AHEAD), person(1.75))
    turned = FootSettings(imu=Placement(q=tuple(rot.from_yaw(math.radians(90.0)).tolist())))
    error = refused(HeadingFlow(Settings(feet=FeetSettings(left=turned))), run.messages())
    assert (error.code, "left foot" in error.message) == (Code.FAILED, True)


def test_who_never_steps_is_told(monkeypatch) -> None:
    run = scenario(monkeypatch, standing(LOOKING_AHEAD), person(1.75), seconds=10.0)
    error = refused(HeadingFlow(person(1.75)), repeated(run.messages(), 10.0, 5))
    assert (error.code, "step" in error.message) == (Code.FAILED, True)


def test_the_camera_s_mount_from_a_look_around(monkeypatch) -> None:
    """The camera sits 1 deg and 5 mm otherwise than the settings say."""
    true = Settings()
    turn = rot.from_rotation_vector([0.012, 0.010, -0.008])
    mount = true.camera.mount
    shift = np.array([0.003, -0.002, 0.004])
    # What fusion should turn into what the true mount gives: p_true = q p + s.
    run = scenario(monkeypatch, standing(LOOKING_AROUND), true, seconds=40.0)
    wrong_q = rot.multiply(rot.conjugate(turn), mount.q)
    wrong_p = rot.unrotate(turn, np.array(mount.p) - shift)
    wrong = Settings(camera=CameraSettings(mount=Placement(p=tuple(wrong_p.tolist()), q=tuple(wrong_q.tolist()))))
    messages = []
    for arrival, message in run.messages():
        if message.stream.startswith("marker/"):
            p = rot.unrotate(turn, np.array(message.data.p) - shift)
            message = message._replace(data=message.data.model_copy(update={"p": tuple(p.tolist())}))
        messages.append((arrival, message))
    flow = MountFlow(wrong)
    told = watch(flow, messages)
    values = flow.found.values
    assert values.base == wrong.camera.mount_hash
    assert math.degrees(float(rot.angle_between(values.q, turn))) < 0.2
    assert np.linalg.norm(np.array(values.p) - shift) < 0.005
    assert re.search(r"off by [456] mm and 1\.[01] degrees", told[-1])


def test_a_lost_head_begins_anew_and_invalid_messages_count_for_nothing(monkeypatch) -> None:
    run = scenario(monkeypatch, standing(LOOKING_AHEAD), person(1.75), seconds=6.0)
    flow = BodyFlow(person(1.75))
    for arrival, message in run.messages():
        if message.stream == "head/pose" and 2.5 < arrival / SECOND < 2.6:
            message = message._replace(data=message.data.model_copy(update={"tracked": False, "p": None, "q": None}))
        flow.take(message, arrival)
        if flow.found is not None:
            assert arrival / SECOND > 5.5
            break
    invalid = BodyFlow(person(1.75))
    for arrival, message in run.messages():
        invalid.take(message._replace(valid=False), arrival)
    assert invalid.found is None and invalid.progress.share == 0.0
