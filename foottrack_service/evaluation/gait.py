"""The gait's figures: ours beside [Z]'s reference and key-frame animation, on the same fused feet."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.evaluation import gait_metrics as metrics
from foottrack_service.evaluation.gait_cases import GaitCase
from foottrack_service.evaluation.gait_runs import MODES, GaitRun, Mode, feet_of, run_gait
from foottrack_service.gait.reference_machine import RATE_HZ
from foottrack_service.rotations import Array
from foottrack_service.simulation.scenario import Scenario, simulate
from foottrack_service.simulation.truth import FootTrack

SECONDS = 20.0
_WARM_UP_S = 0.5
_PAUSE_S = 1.2
"""Between two true toe-offs: more begins a new bout."""


@dataclass(slots=True)
class ModeFigures:
    """One mode's figures of one case. Lengths m, times s."""

    steps: int = 0
    found: int = 0
    extra: int = 0
    walked: int = 0
    """Walks that began (or steps that the reference saw)."""
    jump: float = 0.0
    move: float = 0.0
    """Largest jump and largest movement of a target in a frame."""
    skates: list[float] = field(default_factory=list)
    lags: list[float] = field(default_factory=list)
    correlations: list[float] = field(default_factory=list)
    latencies: list[float] = field(default_factory=list)
    events: dict[str, list[float]] = field(default_factory=dict)
    """Errors of the events' instants."""
    speeds: list[float] = field(default_factory=list)
    way: float = 0.0


@dataclass(slots=True)
class CaseFigures:
    """One case, all modes."""

    case: GaitCase
    modes: dict[Mode, ModeFigures]


def run_case(case: GaitCase) -> CaseFigures:
    """Simulate, fuse once, and animate in every mode. Deterministic."""
    settings = Settings(body={"height": case.height})
    scenario = simulate(
        case.kind,
        case.seed,
        settings=settings,
        seconds=SECONDS,
        imu_hz=case.imu_hz,
        camera=case.camera,
        motion=case.motion,
    )
    instants = feet_of(scenario.messages(), settings)
    return CaseFigures(case, {mode: _figures(run_gait(instants, settings, mode), mode, scenario) for mode in MODES})


def summary(figures: Iterable[CaseFigures]) -> dict[str, Any]:
    """The object that ``--json`` prints under "gait"."""
    figures = list(figures)
    return {mode: _pooled([(f.case, f.modes[mode]) for f in figures], mode) for mode in MODES}


def _figures(run: GaitRun, mode: Mode, scenario: Scenario) -> ModeFigures:
    out = ModeFigures()
    out.walked = sum(event.name == "first_step" for event in run.events)
    out.way = float(np.sum(run.speed[1:] * np.diff(run.t))) if len(run.t) > 1 else 0.0
    walking = run.speed > 0.0
    if np.any(walking):
        out.speeds = run.speed[walking][::20].tolist()
    frames = _own_frames(run, mode)
    for side in SIDES:
        track = scenario.truth.feet[side]
        shown = run.feet[side][frames]
        out.jump = max(out.jump, float(np.max(metrics.jumps_m(run.t[frames], shown), initial=0.0)))
        out.move = max(out.move, float(np.max(np.linalg.norm(np.diff(shown, axis=0), axis=1), initial=0.0)))
        leaves, strikes = _instants(track, scenario.seconds)
        matched = metrics.match(leaves, run.lifted[side], 0.5)
        out.steps += matched.true
        out.found += matched.found
        out.extra += matched.extra
        out.latencies += matched.errors.tolist()
        for name, true in (("toe_off", leaves), ("foot_strike", strikes)):
            at = np.array([event.t for event in run.events if event.side == side and event.name == name])
            out.events.setdefault(name, []).extend(metrics.match(true, at).errors.tolist())
        _feet(out, run, side, track, leaves, strikes)
    return out


def _feet(out: ModeFigures, run: GaitRun, side: Side, track: FootTrack, leaves: Array, strikes: Array) -> None:
    keep = run.t > _WARM_UP_S
    t, target, speed = run.t[keep], run.feet[side][keep], run.speed[keep]
    if len(t) < 10:
        return
    heel, toe = track.contact(t)
    out.skates += metrics.skates_m(t, target[:, 0], target[:, 1], speed, heel | toe)
    user = track.pose(t)[0][:, 1]
    for begin, end in _bouts(leaves, strikes):
        during = (t > begin - 0.4) & (t < end + 0.4)
        if np.count_nonzero(during) > 100 and np.any(speed[during] > 0.0):
            found = metrics.correlation_and_lag(t[during], target[during, 1], user[during])
            if found is not None:
                out.correlations.append(found[0])
                out.lags.append(found[1])


def _own_frames(run: GaitRun, mode: Mode) -> npt.NDArray[np.intp]:
    """Indices of the outputs at which a mode's targets are new: the reference holds them from frame to frame."""
    if mode != "reference":
        return np.arange(len(run.t))
    frames = np.searchsorted(run.t, np.arange(run.t[0], run.t[-1], 1.0 / RATE_HZ) + 1e-3)
    return np.asarray(frames[frames < len(run.t)])


def _instants(track: FootTrack, seconds: float) -> tuple[Array, Array]:
    grid = np.arange(0.0, seconds, 0.001)
    heel, toe = track.contact(grid)
    down = heel | toe
    leaves = grid[1:][~down[1:] & down[:-1]]
    lands = grid[1:][down[1:] & ~down[:-1]]
    # What is still in the air at the end can not be judged.
    return leaves[leaves < seconds - 0.7], lands


def _bouts(leaves: Array, strikes: Array) -> list[tuple[float, float]]:
    if len(leaves) < 2:
        return []
    breaks = np.flatnonzero(np.diff(leaves) > max(_PAUSE_S, 1.6 * float(np.median(np.diff(leaves)))))
    firsts = np.concatenate([[0], breaks + 1])
    lasts = np.concatenate([breaks, [len(leaves) - 1]])
    found = []
    for first, last in zip(firsts, lasts, strict=True):
        after = strikes[strikes > leaves[last]]
        if last > first and len(after):
            found.append((float(leaves[first]), float(after[0])))
    return found


def _pooled(figures: list[tuple[GaitCase, ModeFigures]], mode: Mode) -> dict[str, Any]:
    in_place = [found for case, found in figures if case.kind == "in place"]
    skates = np.array([x for found in in_place for x in found.skates])
    lags = np.array([x for found in in_place for x in found.lags])
    correlations = [x for found in in_place for x in found.correlations]
    latencies = [x for found in in_place for x in found.latencies]
    still = ("knee-bends", "leaning", "upper-body", "head-moving")
    result: dict[str, Any] = {
        "steps": sum(found.steps for found in in_place),
        "found": sum(found.found for found in in_place),
        "extra": sum(found.extra for found in in_place),
        "false_in_squats": sum(found.extra for case, found in figures if case.kind == "knee-bends"),
        "max_jump_mm": _round(1e3 * max((found.jump for _, found in figures), default=0.0), 1),
        "max_move_mm": _round(1e3 * max((found.move for _, found in figures), default=0.0), 1),
        "skate_mm": _round(1e3 * float(np.max(skates)), 2) if len(skates) else None,
        "skate_mm_median": _round(1e3 * float(np.median(skates)), 2) if len(skates) else None,
        "phase_error_ms": _round(1e3 * float(np.mean(np.abs(lags))), 1) if len(lags) else None,
        "correlation": _round(float(np.mean(correlations)), 3) if correlations else None,
        "lift_latency_ms": _round(1e3 * float(np.median(latencies)), 1) if latencies else None,
        "false_when_standing": sum(found.extra for case, found in figures if case.kind in still),
        "false_walks": {
            case.kind: sum(
                f.walked if mode != "reference" else int(f.way > 0.05) for c, f in figures if c.kind == case.kind
            )
            for case, _ in figures
            if case.kind != "in place"
        },
    }
    if mode == "ours":
        result["events_ms"] = {
            name: {"bias": _round(1e3 * float(np.mean(errors)), 1), "sd": _round(1e3 * float(np.std(errors)), 1)}
            for name in ("toe_off", "foot_strike")
            if len(errors := np.array([x for found in in_place for x in found.events[name]]))
        }
    result["speed_by_cadence"] = {
        f"{cadence:g}": _round(float(np.median(speeds)), 2)
        for cadence in sorted({case.cadence for case, _ in figures if case.cadence})
        if len(speeds := [x for case, found in figures if case.cadence == cadence for x in found.speeds])
    }
    return result


def _round(value: float, digits: int) -> float:
    return round(float(value), digits)
