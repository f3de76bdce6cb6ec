"""Filters on public recordings of foot-worn IMUs: no headset and no camera, so this is about drift."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from foottrack_service.config import Settings
from foottrack_service.evaluation import datasets
from foottrack_service.evaluation.datasets import FootTrial
from foottrack_service.evaluation.jobs import FILTERS
from foottrack_service.evaluation.run import run_filter


def real_tables(folder: Path) -> dict[str, dict[str, float]]:
    """Per recording and filter, the rms distance on the floor, m, after rigid alignment. Raises DatasetError."""
    groups = [datasets.gaitmap(folder / "gaitmap")]
    groups += [[datasets.pyshoe(file)] for file in sorted((folder / "llio_pyshoe_vicon_dev").glob("*.npz"))]
    if len(groups) == 1:
        raise datasets.DatasetError(f"{folder / 'llio_pyshoe_vicon_dev'}: no recordings")
    table: dict[str, dict[str, float]] = {}
    for trials in groups:
        for label, name in FILTERS.items():
            for trial, rmse in drift(trials, name).items():
                table.setdefault(trial, {})[f"{label}, m"] = rmse
    return table


def drift(trials: list[FootTrial], filter_name: str) -> dict[str, float]:
    """Rms distance on the floor between a filter's feet and their reference, m, by the trials' names."""
    settings = datasets.settings_with(trials, Settings(fusion={"filter": filter_name}))
    runs, _ = run_filter(datasets.messages(trials, settings), settings)
    found = {}
    for trial in trials:
        run = runs[trial.side]
        seconds = run.t * 1e-9
        east, south = (np.interp(trial.true_t, seconds, run.p[:, axis]) for axis in (0, 2))
        found[trial.name] = round(datasets.aligned_rmse(np.stack([east, -south], axis=-1), trial.true_xy), 4)
    return found
