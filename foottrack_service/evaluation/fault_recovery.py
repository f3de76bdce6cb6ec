"""How soon a foot is back after a fault, in seconds of good measurements.

A foot is back when it stays for STAYS_S within 10 mm of the truth, or of what the same run without the fault is off by
and 3 mm. Each picture after the fault in which the foot's own tag was found, undamaged, counts for one picture's time,
from its arrival on: while nobody sees the tag there is no good measurement, and such time does not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import FusionSettings, Settings
from foottrack_service.evaluation.fault_cases import FAULT_CASES
from foottrack_service.evaluation.processes import processes
from foottrack_service.evaluation.run import run_filter
from foottrack_service.fusion.foot_filter_optical import LEAST_EDGE_PX, SIZE_RATIO
from foottrack_service.rotations import Array
from foottrack_service.simulation import headset
from foottrack_service.simulation.camera import FPS
from foottrack_service.simulation.faults import Fault
from foottrack_service.simulation.imu import ImuKind
from foottrack_service.simulation.scenario import Scenario, simulate

FAULT_TASKS = ("head-moving", "walk-in-place", "walk")
DEVICES: dict[str, tuple[ImuKind, float]] = {
    "raw": ("raw", 200.0),
    "BNO08x": ("bno08x", 200.0),
    "q alone": ("fused", 100.0),
}
"""By name: what the IMU sends, and how often per second."""
DUE_S = 0.5
WITHIN_M, WORSE_THAN_CLEAN_M = 0.010, 0.003
STAYS_S = 0.3
FIRST_S, PAUSE_S, SECONDS = 3.5, 4.0, 26.0
"""When the first fault begins, for how long there is none between two, and how long a run lasts, s."""
_HEALTHY_LATENCY_S = 0.1


@dataclass(frozen=True, slots=True)
class FaultJob:
    """One task with one kind of fault, again and again."""

    case: str
    device: str
    task: str
    seed: int


@dataclass(frozen=True, slots=True)
class Recovery:
    """What one fault did to one foot."""

    job: FaultJob
    side: Side
    over_s: float
    """When it was over."""
    good_s: float
    """Seconds of good measurements until the foot was back, or until the next fault."""
    back: bool
    peak_m: float
    """The largest error from the fault's beginning to the foot's return."""


def fault_jobs(tasks: Sequence[str], seeds: Sequence[int]) -> list[list[FaultJob]]:
    """All faults and devices in those of the tasks that are walked, marched or stood; grouped by their clean run."""
    return [
        [FaultJob(case, device, task, seed) for case in FAULT_CASES]
        for task in FAULT_TASKS
        if task in tasks
        for device in DEVICES
        for seed in seeds
    ]


def run_fault_jobs(groups: Sequence[Sequence[FaultJob]], on_done: Callable[[str], None]) -> list[Recovery]:
    """Run on all cores, in spawned processes. ``on_done`` hears the task of each group as it ends."""
    with processes(len(groups)) as pool:
        waiting = {pool.submit(_run_group, group): index for index, group in enumerate(groups)}
        found: dict[int, list[Recovery]] = {}
        for future in as_completed(waiting):
            found[waiting[future]] = future.result()
            on_done(groups[waiting[future]][0].task)
    return [each for index in sorted(found) for each in found[index]]


def run_fault_job(job: FaultJob) -> list[Recovery]:
    """Simulate with and without the faults, fuse both, compare. Deterministic."""
    case = FAULT_CASES[job.case]
    windows = fault_windows(case.lasts_s, job.seed)
    faults = [case.make(begin, end) for begin, end in windows]
    scenario = _scenario(job.device, job.task, job.seed, faults)
    errors = _errors(scenario, faults)
    clean = _clean_errors(job.device, job.task, job.seed)
    found = []
    for side in case.sides:
        t, error = errors[side]
        allowed = np.maximum(WITHIN_M, np.interp(t, *clean[side]) + WORSE_THAN_CLEAN_M)
        for (begin, end), until in zip(windows, [*(a for a, _ in windows[1:]), SECONDS - 0.1], strict=True):
            good = good_fixes(scenario, side, end, until)
            back = returned(t, error <= allowed, end, until)
            good_s = float(np.sum(good <= (until if back is None else back))) / FPS
            peak = error[(t >= begin) & (t <= (until if back is None else back))]
            found.append(Recovery(job, side, end, good_s, back is not None, float(np.max(peak, initial=0.0))))
    return found


def fault_windows(lasts_s: float, seed: int) -> list[tuple[float, float]]:
    """When the faults of a run begin and end, s."""
    random = np.random.default_rng([seed, 77])
    windows = []
    begin = FIRST_S + float(random.uniform(0.0, 1.0))
    while begin + lasts_s + PAUSE_S < SECONDS:
        windows.append((begin, begin + lasts_s))
        begin += lasts_s + PAUSE_S + float(random.uniform(0.0, 1.0))
    return windows


def returned(t: Array, within: Any, frm: float, until: float) -> float | None:
    """From when on, s, the foot stays within for STAYS_S; None when it does not before ``until``."""
    chosen = (t >= frm) & (t < until)
    t, within = t[chosen], within[chosen]
    back: float | None = None
    for when, good in zip(t.tolist(), within.tolist(), strict=True):
        back = None if not good else when if back is None else back
        if back is not None and when - back >= STAYS_S:
            return back
    return None


def good_fixes(scenario: Scenario, side: Side, frm: float, until: float) -> Array:
    """When the fixes of the foot's own tag arrive that were made between two instants, s, ascending."""
    emission = next(e for e in scenario.emissions if e.stream == f"marker/{side}")
    t, arrives = emission.t * 1e-9, emission.t_pub * 1e-9
    good = (t >= frm) & (t < until) & (arrives > t) & (arrives - t < _HEALTHY_LATENCY_S)
    if emission.false is not None:
        good &= ~emission.false
    for i in np.flatnonzero(good):
        body = emission.body(int(i), 0)
        sized = body.size_ratio is None or SIZE_RATIO[0] <= body.size_ratio <= SIZE_RATIO[1]
        good[i] = sized and body.edge_px >= LEAST_EDGE_PX
    return np.asarray(arrives[good])


def fault_table(found: Sequence[Recovery]) -> dict[str, dict[str, dict[str, Any]]]:
    """By fault and device: median, p95 and worst s of good measurements, how many above DUE_S, peak, mm."""
    table: dict[str, dict[str, dict[str, Any]]] = {}
    for case in dict.fromkeys(each.job.case for each in found):
        for device in dict.fromkeys(each.job.device for each in found):
            mine = [each for each in found if (each.job.case, each.job.device) == (case, device)]
            if mine:
                table.setdefault(case, {})[device] = _figures(mine)
    return table


def _figures(found: Sequence[Recovery]) -> dict[str, Any]:
    good = np.array([each.good_s for each in found])
    late = np.array([not each.back or each.good_s > DUE_S for each in found])
    return {
        "faults": len(found),
        "median": round(float(np.median(good)), 3),
        "p95": round(float(np.percentile(good, 95)), 3),
        "worst": round(float(np.max(good)), 3),
        "late": int(late.sum()),
        "late_share": round(100.0 * float(late.mean()), 2),
        "peak": round(1e3 * max(each.peak_m for each in found), 1),
    }


def _run_group(jobs: Sequence[FaultJob]) -> list[Recovery]:
    return [each for job in jobs for each in run_fault_job(job)]


def _settings() -> Settings:
    return Settings(fusion=FusionSettings(max_output_hz=100.0))


def _scenario(device: str, task: str, seed: int, faults: Sequence[Fault]) -> Scenario:
    kind, hz = DEVICES[device]
    return simulate(task, seed, settings=_settings(), seconds=SECONDS, imu=kind, imu_hz=hz, faults=faults)


@lru_cache(maxsize=4)
def _clean_errors(device: str, task: str, seed: int) -> dict[Side, tuple[Array, Array]]:
    return _errors(_scenario(device, task, seed, ()), ())


def _errors(scenario: Scenario, faults: Sequence[Fault]) -> dict[Side, tuple[Array, Array]]:
    """By side: instants, s, and distances from the truth, m, in the stage as it lay then."""
    arrivals = [(now, m) for now, m in scenario.messages() if not m.stream.startswith("truth/")]
    runs, _ = run_filter(arrivals, scenario.settings)
    changes, stages = headset.stages(faults)
    found: dict[Side, tuple[Array, Array]] = {}
    for side, run in runs.items():
        t = run.t * 1e-9
        true = scenario.truth.feet[side].pose(t)[0]
        origin = np.searchsorted(changes, t, side="right")
        for index, stage in enumerate(stages):
            true[origin == index] = stage.place(true[origin == index])
        found[side] = (t, np.linalg.norm(run.p - true, axis=1))
    return found
