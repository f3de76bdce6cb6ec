"""The same figures for a recording with a reference system's truth, so that anybody can repeat the experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.config import Settings, from_toml
from foottrack_service.evaluation import metrics
from foottrack_service.evaluation.jobs import FILTERS, compare
from foottrack_service.evaluation.run import FootRun, run_filter, split_truth, truth_of
from foottrack_service.evaluation.statistics import summary_mm
from foottrack_service.evaluation.truth import TruthTrack
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.reader import open_recording
from foottrack_service.rotations import Array


def recorded_runs(file: Path, filter_name: str) -> tuple[dict[Side, FootRun], dict[Side, TruthTrack], Settings]:
    """A filter's feet and their truth. Raises RecordingError: damaged, or without any truth."""
    recording = open_recording(file)
    settings = Settings() if recording.config_toml is None else from_toml(recording.config_toml)
    settings = settings.model_copy(update={"fusion": settings.fusion.model_copy(update={"filter": filter_name})})
    aside: dict[Side, list[Message]] = {side: [] for side in SIDES}
    arrivals = ((recorded.arrival, recorded.message) for recorded in recording.messages())
    runs, _ = run_filter(split_truth(arrivals, aside), settings)
    truths = {side: track for side in SIDES if (track := truth_of(aside[side])) is not None}
    if not truths:
        raise RecordingError(file, "carries no truth/left or truth/right to compare with")
    return runs, truths, settings


def recorded_tables(file: Path) -> dict[str, Any]:
    """A row of figures for each filter, both feet pooled. Raises RecordingError."""
    row: dict[str, Any] = {}
    for label, name in FILTERS.items():
        runs, truths, settings = recorded_runs(file, name)
        errors, shares, lags = [], [], []
        for side, truth in truths.items():
            run = runs[side]
            run = run.cut(truth.covers(run.t) & ~np.isnan(run.age))
            arm = np.array(settings.feet.of(side).marker.p) if label == "reference" else np.zeros(3)
            estimate, true = compare(run, truth, arm)
            distance = np.linalg.norm(estimate - true, axis=1)
            errors.append(distance)
            shares.append(distance / np.maximum(run.sigma, 1e-9))
            lags.append(_lag(run, truth))
        known = [lag for lag in lags if lag is not None]
        row[label] = {
            **summary_mm(np.concatenate(errors)),
            "lag": round(1e3 * float(np.mean(known)), 3) if known else None,
            "within_sigma": metrics.within_sigma(np.concatenate(shares), np.ones(1)),
        }
    return row


def _lag(run: FootRun, truth: TruthTrack) -> float | None:
    zero = truth.t[0]
    seconds = (run.t - zero) * 1e-9

    def at(when: Array) -> Array:
        return truth.position(zero + np.round(when * 1e9).astype(np.int64))

    return metrics.lag_s(seconds, run.p, at)
