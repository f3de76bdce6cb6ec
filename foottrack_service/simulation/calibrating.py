"""A person who does what the calibrations ask, again and again: looks down, looks ahead, steps, turns round."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation.easing import ease, there_and_back
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.people import scene
from foottrack_service.simulation.posture import Bearing
from foottrack_service.simulation.stride import CAUTIOUS, Planner
from foottrack_service.simulation.truth import BOTH, Truth, grid


class Announced(NamedTuple):
    """What the person does from an instant on."""

    at: float
    """s."""
    text: str


ROUND_S = 29.0
"""Shorter than any calibration waits: whenever one is begun, it sees what it asks for."""
_AHEAD_S, _NOD_AT_S, _STEP_S, _TURN_S = 8.0, 13.0, 19.0, 24.0
"""Within a round: raises the head, nods, steps forward, turns round. Before the first it looks down."""
_NOD_S = 1.5
_DOWN, _LEVEL = math.radians(60.0), math.radians(5.0)
_STEP = 0.5
"""m."""


def calibration(seconds: float, settings: Settings, feet: Feet, random: np.random.Generator) -> Truth:
    """Stands and looks down, looks ahead, takes one step forward with each foot, stands there, turns round."""
    plan = Planner(random)
    turn = math.pi
    for begin in _rounds(seconds):
        plan.now = begin + _STEP_S
        for side in _by_turns(turn):
            plan.step(side, plan.feet[side].ahead(_STEP), CAUTIOUS, 0.8)
        plan.now = begin + _TURN_S
        plan.turn(turn, CAUTIOUS, 0.75)
        turn = -turn
    # Quiet standing: the head sways by some millimetres, slowly, and the eyes rest.
    bearing = Bearing(look_down=_look_down(grid(seconds)), gaze_sd=math.radians(0.5), sway_sd=0.004, sway_band_hz=0.3)
    return scene(seconds, settings, feet, random, plan, bearing)


def announced(seconds: float) -> list[Announced]:
    """What a bystander would say of it, in order."""
    said: list[Announced] = []
    for begin in _rounds(seconds):
        said += [
            Announced(begin, "stands and looks down at the feet: what calibrate floor asks for"),
            Announced(begin + _AHEAD_S, "looks straight ahead: what calibrate body asks for, and heading first"),
            Announced(begin + _NOD_AT_S, "looks down at the feet and up again: what calibrate body asks for then"),
            Announced(begin + _STEP_S, "takes one step forward: what calibrate heading asks for then"),
            Announced(begin + _TURN_S, "turns round"),
        ]
    return said


def _rounds(seconds: float) -> Array:
    return np.arange(0.0, max(seconds - ROUND_S, 0.0) + 1e-9, ROUND_S)


def _by_turns(turn: float) -> tuple[Side, Side]:
    left, right = BOTH
    return (left, right) if turn > 0.0 else (right, left)


def _look_down(t: Array) -> Array:
    """(n,) rad."""
    at = np.mod(t, ROUND_S)
    raised = ease((at - _AHEAD_S) / _NOD_S) - ease((at - _TURN_S) / _NOD_S)
    raised -= there_and_back(at, _NOD_AT_S, _NOD_AT_S + 2.0 * _NOD_S)
    return np.asarray(_DOWN + (_LEVEL - _DOWN) * raised)
