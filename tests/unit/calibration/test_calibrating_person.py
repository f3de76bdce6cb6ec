"""The simulated person who does what the calibrations ask, and who turns round in between."""

from __future__ import annotations

import math
from functools import cache

import pytest
from calibration_people import SECOND, watch

from foottrack_service.calibration.body import BodyFlow
from foottrack_service.calibration.floor import FloorFlow
from foottrack_service.calibration.flow import READY_TO_WAIT_S
from foottrack_service.calibration.heading import HeadingFlow
from foottrack_service.cli.sim import said
from foottrack_service.config import Settings
from foottrack_service.simulation.calibrating import ROUND_S, announced
from foottrack_service.simulation.scenario import simulate

SETTINGS = Settings()


@cache
def messages():
    return list(simulate("calibration", 4, settings=SETTINGS, seconds=2.0 * ROUND_S, depth=False).messages())


def begun_at(flow, second):
    """Values, and what was said."""
    told = watch(flow, [(at, message) for at, message in messages() if at > second * SECOND], began=second * SECOND)
    return flow.found.values, told


@pytest.mark.parametrize("second", [0, 5, 10, 15, 20, 25])
def test_whenever_a_calibration_is_begun_it_succeeds_while_it_waits(second) -> None:
    assert ROUND_S < READY_TO_WAIT_S - 5.0
    floor, _ = begun_at(FloorFlow(SETTINGS), second)
    assert abs(floor.height) < 0.02
    body, told = begun_at(BodyFlow(SETTINGS), second)
    assert body.height == pytest.approx(1.75, abs=0.02)
    assert told[-2:] == ["Now look down at your feet, and up again.", f"You are {body.height:.2f} m tall."]
    heading, told = begun_at(HeadingFlow(SETTINGS), second)
    # In the second round the person faces the other way.
    assert abs(math.remainder(heading.yaw, math.pi)) < 0.05
    assert (abs(heading.yaw) > 3.0) == (second > 17)
    assert told[-2].startswith("Now take one step")


def test_a_turn_on_the_spot_is_no_step_backwards() -> None:
    """It takes the eyes 0.4 m, and their look half round."""
    _, told = begun_at(HeadingFlow(SETTINGS), 20)
    assert sum(text.startswith("Stand still") for text in told) >= 1
    assert told[-1].startswith("Forward is")


def test_who_stands_still_from_the_start_is_not_told_to() -> None:
    _, told = begun_at(FloorFlow(SETTINGS), 2)
    assert len(told) == 2


def test_what_it_does_is_said_when_its_time_has_come(capsys) -> None:
    say = said("calibration", 2.0 * ROUND_S)
    say(7.9)
    assert capsys.readouterr().err.splitlines() == [f"0:00 {announced(ROUND_S)[0].text}"]
    say(37.0)
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[0] for line in lines] == ["0:08", "0:13", "0:19", "0:24", "0:29", "0:37"]
    said("walk", 30.0)(30.0)
    assert capsys.readouterr().err == ""
