"""Simulated people for the calibrations, and how their messages get into a flow."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from foottrack_protocol import Message
from foottrack_service.calibration.flow import Flow
from foottrack_service.config import Settings
from foottrack_service.simulation import people
from foottrack_service.simulation.posture import Bearing
from foottrack_service.simulation.scenario import Scenario, simulate
from foottrack_service.simulation.stride import CAUTIOUS, Planner
from foottrack_service.simulation.tasks import TASKS, Task

SECOND = 1_000_000_000
LOOKING_DOWN = Bearing(gaze_sd=np.radians(0.2), sway_sd=0.002)
LOOKING_AHEAD = replace(LOOKING_DOWN, look_down=np.radians(5.0))


def standing(bearing: Bearing) -> Callable[..., object]:
    """A task: nothing but standing."""
    return lambda seconds, settings, feet, random: people.scene(
        seconds, settings, feet, random, Planner(random), bearing
    )


def stepping(bearing: Bearing, aside: float = 0.0, turn: float = 0.0) -> Callable[..., object]:
    """A task: stand for 3 s, then a step of 0.5 m, ``aside`` m to the right, with each foot, turned by ``turn``."""

    def truth(seconds, settings, feet, random):
        plan = Planner(random, now=3.0)
        for side in ("left", "right"):
            plan.step(side, plan.feet[side].ahead(0.5, aside, turn), CAUTIOUS, 0.8)
        return people.scene(seconds, settings, feet, random, plan, bearing)

    return truth


def scenario(monkeypatch, truth, settings: Settings, seconds: float = 8.0, seed: int = 3, **options) -> Scenario:
    """Messages of a task that the product has not."""
    monkeypatch.setitem(TASKS, "calibrating", Task("calibrating", "", seconds, truth))
    return simulate("calibrating", seed, settings=settings, seconds=seconds, depth=False, **options)


def raised(messages: Iterable[tuple[int, Message]], height: float) -> Iterable[tuple[int, Message]]:
    """The same in a stage whose floor is at ``height`` m: what the headset says is higher, what the camera sees not."""
    for arrival, message in messages:
        if message.stream == "head/pose" and message.data.tracked:
            x, y, z = message.data.p
            message = message._replace(data=message.data.model_copy(update={"p": (x, y + height, z)}))
        yield arrival, message


def watch(
    flow: Flow, messages: Iterable[tuple[int, Message]], until_s: float | None = None, began: int = 0
) -> list[str]:
    """Run a flow that was ``began`` at so many ns over messages, and on in silence until ``until_s``; what it told the
    person, in order."""
    told = [flow.progress.text]
    flow.begin(began)
    now, last = began, began
    for arrival, message in messages:
        now = arrival
        if any(message.stream.startswith(stream) for stream in flow.streams):
            flow.take(message, now)
        if now - last > SECOND // 20:
            flow.tick(now)
            last = now
        if flow.progress.text != told[-1]:
            told.append(flow.progress.text)
        if flow.found is not None:
            return told
    while until_s is not None and now < until_s * SECOND:
        now += SECOND // 10
        flow.tick(now)
    return told
