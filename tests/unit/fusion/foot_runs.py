"""Runs one foot's filter over a simulated scenario, as the fusion core would, and measures it against the truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.fusion.head_history import HeadHistory
from foottrack_service.fusion.interface import FootEstimate, FootFilter, HeadSample, ImuSample, OpticalFix, Verdict
from foottrack_service.rotations import Array
from foottrack_service.simulation import headset
from foottrack_service.simulation.scenario import Scenario

START = 10**12
"""ns: scenarios do not begin at zero, as clocks do not."""


@dataclass
class Run:
    """What a filter said, once per IMU sample, or per fix where there is no IMU."""

    t: list[float] = field(default_factory=list)
    estimates: list[FootEstimate] = field(default_factory=list)
    verdicts: Counter[tuple[bool, Verdict]] = field(default_factory=Counter)
    """By whether the fix was a false one."""

    def errors(self, scenario: Scenario, side: Side, frm: float = 0.0, to: float = np.inf) -> Array:
        """Distance of the ankle from the truth, m, between two instants, s."""
        t = np.array(self.t)
        chosen = (t >= frm) & (t < to)
        p, _ = scenario.truth.feet[side].pose(t[chosen])
        changes, stages = headset.stages(scenario_faults(scenario))
        for i, where in enumerate(np.searchsorted(changes, t[chosen], side="right")):
            p[i] = stages[where].place(p[i])
        ours = np.array([e.p for e, c in zip(self.estimates, chosen, strict=True) if c])
        return np.asarray(np.linalg.norm(ours - p, axis=1))


_FAULTS: dict[int, tuple[object, ...]] = {}


def scenario_faults(scenario: Scenario) -> tuple[object, ...]:
    """The faults that ``remember`` noted for a scenario."""
    return _FAULTS.get(id(scenario), ())


def remember(scenario: Scenario, faults: tuple[object, ...]) -> Scenario:
    """Note the faults of a scenario, whose recentrings decide which stage the truth is told in."""
    _FAULTS[id(scenario)] = faults
    return scenario


def run(
    make: Callable[[], FootFilter],
    scenario: Scenario,
    side: Side = "left",
    change: Callable[[object], object] | None = None,
) -> Run:
    """Feed a scenario that starts at START to a filter. ``change`` may replace samples and fixes, None drops them."""
    filter_, heads, found = make(), HeadHistory(), Run()
    false = scenario.false_fixes()
    waiting: list[tuple[str, int, int, object, bool]] = []
    origin = None
    for now, message in scenario.messages():
        kind, _, tail = message.stream.partition("/")
        body = message.data
        if message.stream == "head/pose":
            if origin is not None and body.origin != origin:
                moved = None if body.moved is None else (np.array(body.moved.p), np.array(body.moved.q))
                heads.clear() if moved is None else heads.move(*moved)
                filter_.on_recentred(*(moved or (None, None)))
            origin = body.origin
            if body.tracked:
                heads.add(HeadSample(message.t, np.array(body.p), np.array(body.q)))
            else:
                heads.add_untracked(message.t)
        elif kind == "imu" and tail == side:
            sample = ImuSample(
                message.t,
                np.array(body.acc),
                None if body.gyro is None else np.array(body.gyro),
                None if body.q is None else np.array(body.q),
            )
            changed = sample if change is None else change(sample)
            if changed is not None:
                filter_.on_imu(changed)
            _read(filter_, now, found)
        elif kind in ("marker", "depth") and tail == side:
            waiting.append((kind, message.t, now, body, (message.stream, message.seq) in false))
        still = []
        for each in waiting:
            at, newest = heads.at(each[1]), heads.newest
            if at is None or newest is None:
                if now - each[2] < 100_000_000:
                    still.append(each)
                continue
            fix = _fix(each[0], each[1], each[3], at, newest)
            changed = fix if change is None else change(fix)
            if changed is not None:
                found.verdicts[(each[4], filter_.on_fix(changed, now))] += 1
            _read(filter_, now, found)
        waiting = still
    return found


def _fix(kind: str, t: int, body: object, head: HeadSample, newest: HeadSample) -> OpticalFix:
    xx, xy, xz, yy, yz, zz = body.cov
    cov = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    q = None if body.q is None else rot.normalised(body.q)
    alt = None if body.q_alt is None else rot.normalised(body.q_alt)
    return OpticalFix(t, kind, np.array(body.p), q, alt, cov, body.size_ratio, body.edge_px, head, newest)


def _read(filter_: FootFilter, now: int, found: Run) -> None:
    estimate = filter_.estimate(now)
    if estimate is not None:
        found.t.append((now - START) * 1e-9)
        found.estimates.append(estimate)
