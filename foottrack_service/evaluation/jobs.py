"""One evaluated run: a simulated task through one filter, reduced to what tables need."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.config import Settings
from foottrack_service.evaluation import metrics
from foottrack_service.evaluation.fixes import FixNotes, centre_px
from foottrack_service.evaluation.published import Source
from foottrack_service.evaluation.run import FootRun, Truth, run_filter
from foottrack_service.evaluation.smoother import smoothed
from foottrack_service.evaluation.truth import Flags
from foottrack_service.rotations import Array
from foottrack_service.simulation.faults import CameraBlackout
from foottrack_service.simulation.imu import ImuKind
from foottrack_service.simulation.scenario import Scenario, simulate
from foottrack_service.simulation.truth import FootTrack

FilterName = Literal["ours", "reference"]
FILTERS: dict[FilterName, str] = {"reference": "reference", "ours": "error-state"}
"""By the name that reports use: the value of ``[fusion] filter``."""
WARM_UP_S = 1.0
"""Not evaluated: whoever puts a headset on stands for a second."""
CUT_S = 3.0
"""When a technical test takes a source away."""
_GRID_S = 1.0 / metrics.FRAME_HZ


@dataclass(frozen=True, slots=True)
class Job:
    """What to run."""

    task: str
    seed: int
    filter: FilterName
    seconds: float | None = None
    imu_hz: float = 100.0
    imu: ImuKind = "fused"
    feet: Literal["mild", "hard"] = "mild"
    left_imu: bool = True
    only: Source | None = None
    """From CUT_S on, the only optical source that is left ("inertial": none)."""
    gaps_s: float | None = None
    """The camera is dark for so long, again and again, with 3 s of light in between."""
    camera: Literal["simulated", "rendered"] = "simulated"
    """Whether optical measurements are made up, or found in drawn pictures."""


@dataclass(slots=True)
class FootResult:
    """One foot's figures. Distances in m."""

    errors: Array
    in_sigma: Array
    """Errors over the announced radius."""
    lag_s: float | None
    jitter: tuple[float, float] | None
    skates: list[float]
    gap_ends: list[float]
    peak_delay_s: float | None
    tags: Array
    """(n, 2): an accepted true tag's distance from the picture's centre, px, and the error at its instant."""
    smoothed: Array
    """Errors of the smoother (evaluation/smoother); empty where there is none."""


@dataclass(slots=True)
class JobResult:
    """Both feet's, with what the run cost."""

    job: Job
    feet: dict[Side, FootResult]
    accepted: dict[str, int] = field(default_factory=dict)
    rejected: dict[str, int] = field(default_factory=dict)
    fixes: dict[str, int] = field(default_factory=dict)
    """False and good fixes that reached the filter, and what it made of them (evaluation/fixes)."""
    times_real_time: float = 0.0


class ScenarioTruth:
    """A simulated foot's truth at instants in ns."""

    def __init__(self, scenario: Scenario, side: Side) -> None:
        self._start = scenario.start
        self._end_s = scenario.seconds
        self.side = side
        self.track: FootTrack = scenario.truth.feet[side]

    def seconds(self, t: Array) -> Array:
        """Since the scenario's start."""
        return np.asarray((np.asarray(t) - self._start) * 1e-9)

    def covers(self, t: Array) -> Flags:
        """Within the scenario."""
        seconds = self.seconds(t)
        return (seconds >= 0.0) & (seconds <= self._end_s)

    def position(self, t: Array) -> Array:
        """m, (n, 3)."""
        return self.track.pose(self.seconds(t))[0]

    def velocity(self, t: Array) -> Array:
        """m/s, (n, 3)."""
        return self.track.velocity(self.seconds(t))

    def rotation(self, t: Array) -> Array:
        """(n, 4)."""
        return self.track.pose(self.seconds(t))[1]


def run_job(job: Job) -> JobResult:
    """Simulate and fuse. Deterministic."""
    settings = Settings(fusion={"filter": FILTERS[job.filter]})
    scenario = scenario_of(job, settings)
    arrivals: Iterable[tuple[int, Message]] = scenario.messages()
    if job.camera == "rendered":
        from foottrack_service.evaluation.rendered import with_pictures

        arrivals = list(
            _outside(
                with_pictures(scenario, job.feet, covered_from=CUT_S if job.only == "depth" else None), gap_windows(job)
            )
        )
    began = time.perf_counter()
    notes = FixNotes()
    runs, core = run_filter(_left_on(arrivals, job.only), settings, notes.make)
    took = time.perf_counter() - began
    result = JobResult(job, {}, times_real_time=scenario.seconds / took)
    if job.camera == "simulated":
        result.fixes = notes.counts(scenario, WARM_UP_S)
    for health in core.health.values():
        for into, counts in ((result.accepted, health.accepted), (result.rejected, health.rejected)):
            for name, count in counts.items():
                into[name] = into.get(name, 0) + count
    for side in SIDES:
        arm = np.array(settings.feet.of(side).marker.p) if job.filter == "reference" else np.zeros(3)
        result.feet[side] = _figures(runs[side], ScenarioTruth(scenario, side), arm, job, scenario, notes)
    return result


def scenario_of(job: Job, settings: Settings) -> Scenario:
    """The simulated scenario of a job."""
    return simulate(
        job.task,
        job.seed,
        settings=settings,
        seconds=job.seconds,
        imu_hz=job.imu_hz,
        imu=job.imu,
        feet=job.feet,
        left_imu=job.left_imu,
        faults=[CameraBlackout(start=begin, end=end) for begin, end in gap_windows(job)],
    )


def gap_windows(job: Job) -> list[tuple[float, float]]:
    """When the camera is dark, s."""
    if job.gaps_s is None:
        return []
    begins = np.arange(4.0, (job.seconds or 30.0) - job.gaps_s - 0.5, job.gaps_s + 3.0)
    return [(float(begin), float(begin) + job.gaps_s) for begin in begins]


def compare(run: FootRun, truth: Truth, arm: Array) -> tuple[Array, Array]:
    """Estimated and true places, m, (n, 3), of the foot's point ``arm``: the ankle, or the tag for [B]'s filter.

    To [B]'s filter tag and ankle are one point, so it is judged by the tag, which is what it follows.
    """
    true = truth.position(run.t)
    if not np.any(arm):
        return run.p, true
    return run.point(arm), true + rot.rotate(truth.rotation(run.t), arm)


def _figures(
    run: FootRun, truth: ScenarioTruth, arm: Array, job: Job, scenario: Scenario, notes: FixNotes
) -> FootResult:
    first_s = WARM_UP_S if job.only is None else CUT_S
    run = run.cut(truth.covers(run.t) & ~np.isnan(run.age) & (truth.seconds(run.t) >= first_s))
    estimate, true = compare(run, truth, arm)
    seconds = truth.seconds(run.t)
    errors = np.linalg.norm(estimate - true, axis=1)

    def true_at(when: Array) -> Array:
        p, q = truth.track.pose(when)
        return p + rot.rotate(q, np.broadcast_to(arm, p.shape))

    frames = np.arange(first_s, scenario.seconds, _GRID_S)
    shown = np.clip(np.searchsorted(seconds, frames, side="right") - 1, 0, max(0, len(seconds) - 1))
    heel, toe = truth.track.contact(seconds)
    planted = heel & toe
    still = job.task in ("still", "head-moving", "head-bench", "upper-body") and len(seconds) > 0
    return FootResult(
        errors=errors.astype(np.float32),
        in_sigma=(errors / np.maximum(run.sigma, 1e-9)).astype(np.float32),
        lag_s=metrics.lag_s(seconds, estimate, true_at),
        jitter=metrics.jitter_m(estimate[shown], true[shown]) if still else None,
        skates=metrics.skate_m(estimate - true, planted) if len(planted) else [],
        gap_ends=_gap_ends(seconds, errors, gap_windows(job)),
        peak_delay_s=_peak_delay(seconds, errors, truth) if job.task == "sudden-move" else None,
        tags=_tags(seconds, errors, scenario, notes, truth.side),
        smoothed=_smoothed(scenario, notes, truth) if _has_smoother(job) else np.empty(0, dtype=np.float32),
    )


def _has_smoother(job: Job) -> bool:
    return job.filter == "ours" and job.camera == "simulated" and job.only is None and job.gaps_s is None


def _tags(seconds: Array, errors: Array, scenario: Scenario, notes: FixNotes, side: Side) -> Array:
    fixes = notes.good_tags(scenario, side)
    if not fixes or len(seconds) == 0:
        return np.empty((0, 2))
    t = (np.array([fix.t for fix in fixes]) - scenario.start) * 1e-9
    rows = np.stack([centre_px(fixes, scenario.settings), np.interp(t, seconds, errors)], axis=1)
    return np.asarray(rows[t >= seconds[0]])


def _smoothed(scenario: Scenario, notes: FixNotes, truth: ScenarioTruth) -> Array:
    samples = [m for _, m in scenario.messages() if m.stream == f"imu/{truth.side}" and m.valid]
    t = truth.seconds(np.array([m.t for m in samples], dtype=np.int64)) - scenario.settings.timing.imu_delay
    acc = np.array([m.data.acc for m in samples]).reshape(-1, 3)
    fixes, foot = notes.good_tags(scenario, truth.side), scenario.settings.feet.of(truth.side)
    times, ankle = smoothed(t, acc, fixes, scenario.start, truth.track, foot)
    late = times >= WARM_UP_S
    errors = np.linalg.norm(ankle - truth.track.pose(times)[0], axis=1)
    return np.asarray(errors[late].astype(np.float32))


def _gap_ends(seconds: Array, errors: Array, windows: Sequence[tuple[float, float]]) -> list[float]:
    ends = []
    for _, end in windows:
        before = np.flatnonzero(seconds <= end)
        if len(before):
            ends.append(float(errors[before[-1]]))
    return ends


def _peak_delay(seconds: Array, errors: Array, truth: ScenarioTruth) -> float | None:
    """Mean over the moves of [B]'s latency."""
    grid = np.arange(CUT_S, seconds[-1], 0.005) if len(seconds) else np.empty(0)
    moving = np.linalg.norm(truth.track.velocity(grid), axis=1) > 0.05
    onsets = grid[1:][moving[1:] & ~moving[:-1]]
    delays = []
    for onset in onsets:
        window = (seconds >= onset) & (seconds < onset + 1.0)
        found = metrics.peak_delay_s(seconds[window], errors[window], float(onset)) if np.any(window) else None
        if found is not None:
            delays.append(found)
    return float(np.mean(delays)) if delays else None


def _outside(
    arrivals: Iterable[tuple[int, Message]], windows: Sequence[tuple[float, float]]
) -> Iterator[tuple[int, Message]]:
    """Without what was seen while the camera was dark: the simulation leaves that out by itself."""
    for arrival, message in arrivals:
        optical = message.stream.startswith(("marker/", "depth/"))
        if not (optical and any(begin <= message.t * 1e-9 < end for begin, end in windows)):
            yield arrival, message


def _left_on(arrivals: Iterable[tuple[int, Message]], only: Source | None) -> Iterator[tuple[int, Message]]:
    for arrival, message in arrivals:
        if message.stream.startswith("truth/"):
            continue
        kind = message.stream.partition("/")[0]
        dark = only is not None and kind in ("marker", "depth") and kind != only
        if not (dark and message.t > CUT_S * 1e9):
            yield arrival, message
