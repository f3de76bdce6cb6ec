"""Where and when each foot stands on a path."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from foottrack_service.walkcycle.cycle import STRIKE, Cycle
from foottrack_service.walkcycle.errors import PathError
from foottrack_service.walkcycle.path import Path
from foottrack_service.walkcycle.skeleton import SIDES

Array = npt.NDArray[np.float64]

LIFT_AT_START = 0.55
"""Share of the cycle's pitch with which a foot leaves when it only catches up half a stride."""
PITCH_AT_CLOSE = 0.25
"""Share of the cycle's pitch with which the last foot lands beside the other."""
SETTLE = 0.12
"""Cycles after the last strike until everything stands still."""


@dataclass(frozen=True)
class Footprint:
    """One contact of one foot. `place` (x, z) m is the floor below the ankle of the flat foot, `yaw` rad.
    Phases are in cycles of the walk: strike, flat, heel_off, toe_off; a
    foot that stands from the beginning has strike and flat at minus infinity, one that stays has heel_off and toe_off
    at infinity. `arc` and `aside` (left, +) say in metres where that is on the path. `lift` and `land` scale the pitch
    with which it leaves and with which it arrived.
    """

    side: str
    place: tuple[float, float]
    yaw: float
    strike: float
    flat: float
    heel_off: float
    toe_off: float
    arc: float
    aside: float
    lift: float = 1.0
    land: float = 1.0

    def moved(self, path: Path, ahead: float = 0.0, left: float = 0.0, turn: float = 0.0) -> Footprint:
        """The same contact beside itself, m along and across `path`, and turned, rad."""
        arc, aside = self.arc + ahead, self.aside + left
        was, now = path.heading(np.array([self.arc, arc]))
        x, z = path.offset(np.array([arc]), aside)[0]
        yaw = self.yaw + float(now - was) + turn
        return replace(self, place=(float(x), float(z)), yaw=yaw, arc=arc, aside=aside)


@dataclass(frozen=True)
class Plan:
    """Footprints per side in order, the guide's knots (phase, arc length), and the phases of beginning and end."""

    footprints: dict[str, list[Footprint]]
    knots: tuple[Array, Array]
    start: float
    end: float
    from_rest: bool
    to_rest: bool


def plan_walk(cycle: Cycle, path: Path, steps: int | None = None, *, start: bool = True, stop: bool = True) -> Plan:
    """Footprints along a path.

    Without `steps`, the walk covers the path with steps that fit it (the cycle's own, shortened to end exactly at
    its end); with, it takes that many steps of the cycle's length. With `start` it sets off from standing
    with the right foot, with `stop` the last step closes the feet. Raises PathError when the path is too short.
    """
    step = cycle.step
    if steps is None:
        if path.length < step:
            raise PathError(f"the path is {path.length:.2f} m long, shorter than one step of {step:.2f} m")
        # Rather a little shorter than stretched: legs that are nearly straight have no length to spare.
        steps = max(1, math.ceil(path.length / step - 0.02))
        step = path.length / steps
    elif steps < 1:
        raise PathError(f"a walk needs at least 1 step, not {steps}")
    elif steps * step > path.length + 1e-6:
        raise PathError(
            f"{steps} steps of {step:.2f} m need {steps * step:.2f} m, and the path is {path.length:.2f} m long"
        )

    timing = cycle.project.contact
    feet: dict[str, list[Footprint]] = {side: [] for side in SIDES}
    begin = 0.5 + timing.heel_off - 1.0 if start else 0.0

    def put(
        side: str, arc: float, strike: float, first: bool, last: bool, lift: float = 1.0, land: float = 1.0
    ) -> None:
        at = np.array([arc])
        x, z = path.offset(at, cycle.stance_x[side])[0]
        yaw = float(path.heading(at)[0]) + cycle.stance_yaw[side]
        feet[side].append(
            Footprint(
                side,
                (float(x), float(z)),
                yaw,
                strike=-np.inf if first else strike,
                flat=-np.inf if first else strike + timing.flat,
                heel_off=np.inf if last else strike + timing.heel_off,
                toe_off=np.inf if last else strike + timing.toe_off,
                arc=arc,
                aside=cycle.stance_x[side],
                lift=lift,
                land=land,
            )
        )

    # Strike n (n = 0, 1, 2 ...) comes at phase n / 2, the left foot's being even, at arc length n steps.
    if start:
        closes_at_once = stop and steps == 1
        put("left", 0.0, STRIKE["left"], first=True, last=False, lift=LIFT_AT_START if closes_at_once else 1.0)
        put("right", 0.0, STRIKE["right"] - 1.0, first=True, last=False, lift=LIFT_AT_START)
        knots = [(begin, 0.0)]
        first_strike = 1
    else:
        put("right", -step, -0.5, first=False, last=False)
        first_strike, knots = 0, [(-0.5, -1.5 * step + cycle.lead), (0.0, -0.5 * step + cycle.lead)]
    last_strike = steps
    for n in range(first_strike, last_strike + 1):
        side = SIDES[n % 2]
        leaves_closing = stop and n == last_strike - 1
        put(
            side,
            n * step,
            0.5 * n,
            first=False,
            last=stop and n == last_strike,
            lift=LIFT_AT_START if leaves_closing else 1.0,
        )
        if n > 0:
            knots.append((0.5 * n, (n - 0.5) * step + cycle.lead))
    if stop:
        other, close = SIDES[(last_strike + 1) % 2], 0.5 * (last_strike + 1)
        put(other, last_strike * step, close, first=False, last=True, land=PITCH_AT_CLOSE)
        end = close + max(timing.flat, SETTLE)
        knots.append((end, last_strike * step))
    else:
        # The feet go on beyond the end, which lies on the last strike.
        end = 0.5 * last_strike
        for n in (last_strike + 1, last_strike + 2):
            put(SIDES[n % 2], n * step, 0.5 * n, first=False, last=False)
            knots.append((0.5 * n, (n - 0.5) * step + cycle.lead))
    phases, arcs = np.array(knots).T
    return Plan(feet, (phases, arcs), begin, end, start, stop)
