"""What the simulated person does: the technical bench and the user study of [B], walking in place, a normal walk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from foottrack_service.config import Settings
from foottrack_service.simulation import bench, calibrating, people, stairs
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.truth import Truth

Maker = Callable[[float, Settings, Feet, np.random.Generator], Truth]


@dataclass(frozen=True)
class Task:
    """One task. ``truth`` makes it: (seconds, settings, feet, random) to Truth."""

    name: str
    description: str
    seconds: float
    """How long it lasts unless told otherwise."""
    truth: Maker
    announced: Callable[[float], Sequence[calibrating.Announced]] | None = None
    """What is said while it lasts so many s, to people who play along."""


TASKS: dict[str, Task] = {
    task.name: task
    for task in (
        Task("still", "bench: headset fixed at 1.5 m, trackers lie on the floor", 60.0, bench.still),
        Task("head-moving", "standing, looking and leaning about with the head", 20.0, people.head_moving),
        Task("steps", "one step forward and back, again and again", 30.0, people.steps),
        Task("side-steps", "one step to the side and back, to both sides", 30.0, people.side_steps),
        Task("line", "a straight line of 2 m, turning at its ends", 30.0, people.line),
        Task("circle", "round a circle of 2 m diameter, to and fro", 30.0, people.circle),
        Task("knee-bends", "deep and slow, feet where they are", 20.0, people.knee_bends),
        Task("upper-body", "the upper body turns left and right over standing feet", 20.0, people.upper_body),
        Task(
            "tracker-moving",
            "bench: headset fixed at 1.5 m, trackers moved left, right, forwards, back, up, down, in a circle",
            40.0,
            bench.tracker_moving,
        ),
        Task("head-bench", "bench: trackers fixed, the headset moved the same ways", 40.0, bench.head_bench),
        Task("sudden-move", "bench: trackers lie still, then are flicked aside fast", 20.0, bench.sudden_move),
        Task("walk-in-place", "knees up without going anywhere, with pauses", 30.0, people.walk_in_place),
        Task("walk", "a normal walk of 1.27 m/s with stops and turns", 30.0, people.walk),
        Task("stairs", "up two stairs of 17 cm and down again, backwards, with rests", 30.0, stairs.stairs),
        Task("s-curve", "a normal walk along an S", 20.0, people.s_walk),
        Task(
            "calibration",
            "does what calibrate floor, body and heading ask for, round after round of 29 s, and says when",
            10.0 * calibrating.ROUND_S,
            calibrating.calibration,
            calibrating.announced,
        ),
    )
}
"""By name."""
