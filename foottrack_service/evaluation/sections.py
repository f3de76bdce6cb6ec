"""The parts of the report: which runs each needs, and what it makes of them.

``tasks``: every task, both feet with IMU, and a smoother as the lower bound. ``technical``: [B]'s bench by the source
that is left on. ``study``: [B]'s six tasks with the left foot without IMU. ``variants``: 400 Hz, hard feet, raw axes,
a BNO08x over SHTP.
``gaps``: the camera goes dark in a walk. ``covered``: the tags are covered after 3 s, and depth alone shows the shoes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.evaluation.fixes import CENTRE_BINS_PX
from foottrack_service.evaluation.jobs import FILTERS, Job, JobResult, run_job
from foottrack_service.evaluation.metrics import within_sigma
from foottrack_service.evaluation.processes import processes
from foottrack_service.evaluation.published import (
    STUDY_ALL_MM,
    STUDY_MEDIAN_MM,
    TECHNICAL_LATENCY_S,
    TECHNICAL_MM,
)
from foottrack_service.evaluation.statistics import summary_mm
from foottrack_service.simulation.tasks import TASKS

Section = Literal["tasks", "technical", "study", "variants", "gaps", "covered"]
SECTIONS: tuple[Section, ...] = ("tasks", "technical", "study", "variants", "gaps", "covered")
VARIANTS: dict[str, dict[str, Any]] = {
    "400 Hz": {"imu_hz": 400.0},
    "hard feet": {"feet": "hard"},
    "400 Hz, hard feet": {"imu_hz": 400.0, "feet": "hard"},
    "400 Hz, raw axes": {"imu_hz": 400.0, "imu": "raw"},
    "400 Hz, BNO08x": {"imu_hz": 400.0, "imu": "bno08x"},
}
GAPS_S = (0.5, 1.0, 2.0, 5.0)
_TECHNICAL_SECONDS = {"still": 60.0}

Results = dict[Job, JobResult]
Camera = Literal["simulated", "rendered"]


def jobs_of(section: Section, tasks: Sequence[str], seeds: Sequence[int], camera: Camera = "simulated") -> list[Job]:
    """The runs that a section needs, for tasks and seeds that were asked for."""
    filtered = [Job(task, seed, name, camera=camera) for task in tasks for seed in seeds for name in FILTERS]
    if section == "tasks":
        return filtered
    if section == "technical":
        wanted = [job for job in filtered if job.task in (*TECHNICAL_MM, "sudden-move")]
        return [
            replace(job, only=source, seconds=_TECHNICAL_SECONDS.get(job.task))
            for job in wanted
            for source in TECHNICAL_LATENCY_S
        ]
    if section == "covered":
        return [replace(job, only="depth") for job in filtered]
    if section == "study":
        return [replace(job, left_imu=False) for job in filtered if job.task in STUDY_MEDIAN_MM]
    if section == "variants":
        return [replace(job, **options) for options in VARIANTS.values() for job in filtered]
    return [replace(job, gaps_s=gap, seconds=40.0) for gap in GAPS_S for job in filtered if job.task == "walk"]


def run_jobs(jobs: Iterable[Job], on_done: Callable[[JobResult], None]) -> Results:
    """Run on all cores, in spawned processes. ``on_done`` hears of each as it ends."""
    results: Results = {}
    # Jobs of the same pictures go to the same process: they are drawn once.
    groups: dict[Job, list[Job]] = {}
    for job in dict.fromkeys(jobs):
        groups.setdefault(replace(job, filter="ours") if job.camera == "rendered" else job, []).append(job)
    with processes(len(groups)) as pool:
        for future in as_completed([pool.submit(_run_all, group) for group in groups.values()]):
            for result in future.result():
                results[result.job] = result
                on_done(result)
    return results


def tables(
    section: Section, results: Results, tasks: Sequence[str], seeds: Sequence[int], camera: Camera = "simulated"
) -> dict[str, Any]:
    """A section's figures, as ``--json`` prints them."""
    wanted = jobs_of(section, tasks, seeds, camera)
    found = [results[job] for job in wanted]
    if section in ("tasks", "covered"):
        return {task: _row(task, [r for r in found if r.job.task == task]) for task in tasks}
    if section == "variants":
        return {
            label: {
                task: _row(task, [r for r in found if r.job.task == task and _is(r.job, options)]) for task in tasks
            }
            for label, options in VARIANTS.items()
        }
    if section == "technical":
        return _technical(found)
    if section == "study":
        return _study(found)
    return {
        f"{gap:g}": {name: _gap([r for r in found if r.job.gaps_s == gap and r.job.filter == name]) for name in FILTERS}
        for gap in GAPS_S
    }


def figures(results: Sequence[JobResult], sides: Sequence[Side] = SIDES) -> dict[str, Any]:
    """Pooled over runs and feet: mean, median, p95, max in mm, lag in ms, and the rest."""
    feet = [result.feet[side] for result in results for side in sides]
    errors = _joined(foot.errors for foot in feet)
    lags = [foot.lag_s for foot in feet if foot.lag_s is not None]
    jitters = [foot.jitter for foot in feet if foot.jitter is not None]
    skates = [skate for foot in feet for skate in foot.skates]
    return {
        **summary_mm(errors),
        "lag": _rounded(1e3 * float(np.mean(lags))) if lags else None,
        "jitter": _rounded(1e3 * float(np.mean([jitter[0] for jitter in jitters]))) if jitters else None,
        "frame_to_frame": _rounded(1e3 * float(np.mean([jitter[1] for jitter in jitters]))) if jitters else None,
        "skate": _rounded(1e3 * float(np.mean(skates))) if skates else None,
        "within_sigma": within_sigma(_joined(foot.in_sigma for foot in feet), np.ones(1)),
        "accepted": _added(result.accepted for result in results),
        "rejected": _added(result.rejected for result in results),
        **_fix_shares(_added(result.fixes for result in results)),
        "by_centre_px": _by_centre(np.concatenate([np.empty((0, 2)), *(foot.tags for foot in feet)])),
    }


def _fix_shares(counts: dict[str, int]) -> dict[str, float | None]:
    """Per cent of false fixes that were rejected, and of good ones that were lost; nil where there were none."""

    def share(part: str, of: str) -> float | None:
        return _rounded(100.0 * counts[part] / counts[of]) if counts.get(of) else None

    return {"false_rejected": share("false_rejected", "false"), "good_lost": share("good_lost", "good")}


def _by_centre(tags: Any) -> dict[str, dict[str, float | None]]:
    """Errors by the tag's distance from the picture's centre."""
    return {
        f"{low}-{high}": summary_mm(tags[(tags[:, 0] >= low) & (tags[:, 0] < high), 1])
        for low, high in pairwise(CENTRE_BINS_PX)
    }


def _run_all(jobs: Sequence[Job]) -> list[JobResult]:
    return [run_job(job) for job in jobs]


def _row(task: str, found: Sequence[JobResult]) -> dict[str, Any]:
    row: dict[str, Any] = {
        name: figures([result for result in found if result.job.filter == name]) for name in ("reference", "ours")
    }
    bound = _joined(foot.smoothed for result in found for foot in result.feet.values())
    if len(bound):
        row["smoother"] = {**summary_mm(bound), "lag": None}
    row["published"] = _published(task)
    return row


def _published(task: str) -> dict[str, float | None]:
    """[B]'s figures of a task: the foot with an IMU in the study, the marker stage on the bench. Nil where none."""
    mean, peak = TECHNICAL_MM.get(task, {}).get("marker", (None, None))
    median = STUDY_MEDIAN_MM[task][1] if task in STUDY_MEDIAN_MM else None
    lag = 1e3 * TECHNICAL_LATENCY_S["marker"] if task == "sudden-move" else None
    return {"mean": mean, "median": median, "p95": None, "max": peak, "lag": lag}


def _technical(found: Sequence[JobResult]) -> dict[str, Any]:
    table: dict[str, Any] = {}
    for task in dict.fromkeys(result.job.task for result in found):
        for source, latency in TECHNICAL_LATENCY_S.items():
            row: dict[str, Any] = {}
            for name in FILTERS:
                mine = [r for r in found if (r.job.task, r.job.only, r.job.filter) == (task, source, name)]
                delays = [foot.peak_delay_s for r in mine for foot in r.feet.values() if foot.peak_delay_s is not None]
                row[name] = {
                    **figures(mine),
                    "peak_delay": _rounded(1e3 * float(np.mean(delays))) if delays else None,
                }
            mean, peak = TECHNICAL_MM.get(task, {}).get(source, (None, None))
            delay = 1e3 * latency if task == "sudden-move" else None
            row["published"] = {"mean": mean, "max": peak, "peak_delay": delay}
            table.setdefault(task, {})[source] = row
    return table


def _study(found: Sequence[JobResult]) -> dict[str, Any]:
    tasks = list(dict.fromkeys(result.job.task for result in found))
    table: dict[str, Any] = {}
    for task in (*tasks, "all"):
        mine = [result for result in found if task in ("all", result.job.task)]
        row: dict[str, Any] = {}
        for index, side in enumerate(SIDES):
            published = {"mean": None, "median": STUDY_MEDIAN_MM[task][index]} if task != "all" else None
            row[side] = {
                name: figures([result for result in mine if result.job.filter == name], [side]) for name in FILTERS
            }
            row[side]["published"] = published or {
                "mean": STUDY_ALL_MM["mean"][index],
                "median": STUDY_ALL_MM["median"][index],
            }
        table[task] = row
    return table


def _gap(found: Sequence[JobResult]) -> dict[str, float | None]:
    ends = [end for result in found for foot in result.feet.values() for end in foot.gap_ends]
    if not ends:
        return {"median": None, "p90": None}
    return {"median": _rounded(1e3 * float(np.median(ends))), "p90": _rounded(1e3 * float(np.percentile(ends, 90)))}


def _is(job: Job, options: dict[str, Any]) -> bool:
    plain = {"imu_hz": 100.0, "feet": "mild", "imu": "fused"}
    return all(getattr(job, name) == value for name, value in {**plain, **options}.items())


def _joined(arrays: Iterator[Any] | Iterable[Any]) -> Any:
    parts = list(arrays)
    return np.concatenate(parts) if parts else np.empty(0)


def _added(counts: Iterable[dict[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for each in counts:
        for name, count in each.items():
            total[name] = total.get(name, 0) + count
    return total


def _rounded(value: float) -> float:
    return round(value, 3)


def all_tasks() -> list[str]:
    """Names of all simulated tasks."""
    return [name for name, task in TASKS.items() if task.announced is None]
