"""What the feet do when: the events of a walk at their own instants."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from foottrack_service.walkcycle.skeleton import SIDES
from foottrack_service.walkcycle.walk import Walk

Array = npt.NDArray[np.float64]

LANDING_HEIGHT_M = 0.1
"""Ankle over its standing height below which a foot that comes down is in terminal swing."""
_MID_SHARE = 0.1
"""Of the swing, on either side of its highest point, that is mid swing."""

Kind = Literal["heel_off", "toe_off", "mid_swing", "terminal_swing", "foot_strike", "first_step", "stop"]
Phase = Literal["stance", "ascending", "mid_swing", "descending", "terminal_swing"]


@dataclass(frozen=True)
class Event:
    """`time` s, `side` None for events of the pair, `step` the number of the strike that it leads to or is."""

    time: float
    kind: Kind
    side: str | None
    step: int


@dataclass(frozen=True)
class Swing:
    """One swing in seconds: from toe-off over the highest point and the landing height to the strike."""

    side: str
    toe_off: float
    top: float
    terminal: float
    strike: float

    def phase(self, time: float) -> Phase:
        margin = _MID_SHARE * (self.strike - self.toe_off)
        if time < self.top - margin:
            return "ascending"
        if time <= self.top + margin:
            return "mid_swing"
        return "descending" if time < self.terminal else "terminal_swing"


def swings(walk: Walk) -> list[Swing]:
    """All swings that lie wholly within the walk, in the order of their strikes."""
    found = []
    for side in SIDES:
        prints = walk.plan.footprints[side]
        for now, following in pairwise(prints):
            if now.toe_off < walk.plan.start or following.strike > walk.plan.end:
                continue
            toe_off, strike = (float(t) for t in walk.clock.time([now.toe_off, following.strike]))
            times = np.linspace(toe_off, strike, 201)
            height = walk.targets(times).feet[side].ankle[:, 1] - walk.body.ankle_height
            top = int(np.argmax(height))
            low = np.flatnonzero(height[top:] < LANDING_HEIGHT_M * walk.body.scale)
            after = top + int(low[0]) if low.size and low[0] > 0 else (top + 200) // 2
            found.append(Swing(side, toe_off, float(times[top]), float(times[after]), strike))
    return sorted(found, key=lambda swing: swing.strike)


def walk_events(walk: Walk) -> list[Event]:
    """Events in order of time. The pair's `first_step` comes with the first toe-off from standing, `stop` when
    everything stands."""
    inside = (walk.plan.start, walk.plan.end)
    strikes = sorted(
        p.strike for side in SIDES for p in walk.plan.footprints[side] if inside[0] <= p.strike <= inside[1]
    )
    events: list[Event] = []

    def add(phase: float, kind: Kind, side: str, step: int) -> None:
        if inside[0] <= phase <= inside[1]:
            events.append(Event(float(walk.clock.time(phase)), kind, side, step))

    def number(strike: float) -> int:
        return int(np.searchsorted(strikes, strike - 1e-9)) + 1

    for side in SIDES:
        prints = walk.plan.footprints[side]
        for now, following in zip(prints, [*prints[1:], None], strict=True):
            add(now.strike, "foot_strike", side, number(now.strike))
            if following is not None:
                add(now.heel_off, "heel_off", side, number(following.strike))
                add(now.toe_off, "toe_off", side, number(following.strike))
    for swing in swings(walk):
        step = number(float(walk.clock.phase(swing.strike)))
        events.append(Event(swing.top, "mid_swing", swing.side, step))
        events.append(Event(swing.terminal, "terminal_swing", swing.side, step))
    if walk.plan.from_rest and events:
        first = min((e for e in events if e.kind == "toe_off"), key=lambda e: e.time)
        events.append(Event(first.time, "first_step", first.side, first.step))
    if walk.plan.to_rest:
        events.append(Event(walk.duration, "stop", None, len(strikes)))
    return sorted(events, key=lambda e: e.time)
