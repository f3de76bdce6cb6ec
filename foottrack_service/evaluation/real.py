"""Filters and peers on public recordings of foot-worn IMUs: no headset and no camera, so this is about drift.

Ours and the reference only look back, with one configuration for all; a peer looks at a whole recording.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.evaluation import datasets, peers
from foottrack_service.evaluation.datasets import FootTrial
from foottrack_service.evaluation.jobs import FILTERS
from foottrack_service.evaluation.run import FootRun, run_filter
from foottrack_service.evaluation.truth import Flags
from foottrack_service.rotations import Array

Tables = dict[str, dict[str, dict[str, float | None]]]
XIO_HZ = 400.0
PUBLISHED_RETURN_MM = {"xio short_walk": 82.0, "xio long_walk": 421.0}
"""By the recordings' makers, in all three axes."""
_STANCE_S = 0.1
"""So near a stride's end a stance has to be."""


def real_tables(folder: Path, begin: Callable[[str], None]) -> Tables:
    """``tracks``: rms distance on the floor, m, after rigid alignment. ``returns``: where a walk ends that ends where
    it began, mm, in the plane and in height. ``strides``: lengths against the heel's marker, rms mm.

    ``begin`` is told what is looked at. A peer that is not installed has no column. Raises DatasetError.
    """
    walks = [datasets.levelled(trial) for trial in datasets.gaitmap(folder / "gaitmap")]
    strides = datasets.gaitmap_strides(folder / "gaitmap")
    files = sorted((folder / "llio_pyshoe_vicon_dev").glob("*.npz"))
    if not files:
        raise datasets.DatasetError(f"{folder / 'llio_pyshoe_vicon_dev'}: no recordings")
    tables: Tables = {"tracks": {}, "returns": {}, "strides": {}}
    for file in files:
        trial = datasets.levelled(datasets.pyshoe(file))
        begin(trial.name)
        row = tables["tracks"].setdefault(trial.name, {})
        for label, name in FILTERS.items():
            row[label] = _track_error(trial, _runs([trial], name)[trial.side])
        row["learned detector (pyshoe)"] = datasets.aligned_rmse(datasets.pyshoe_peer(file), trial.true_xy)
    tables["tracks"]["median"] = _medians(tables["tracks"])
    for name in PUBLISHED_RETURN_MM:
        begin(name)
        tables["returns"][name] = _returns(datasets.xio(folder / "xio_gait" / f"{name.removeprefix('xio ')}.csv"))
    begin("gaitmap")
    for label, name in FILTERS.items():
        runs = _runs(walks, name)
        for trial in walks:
            run, ends = runs[trial.side], strides[trial.side]
            row = tables["strides"].setdefault(trial.name, {"strides": float(len(ends))})
            row[f"found, {label}"] = float(np.count_nonzero(_stands(run, ends).all(axis=1)))
            row[f"{label}, mm"] = _stride_error_mm(trial, ends, run.t * 1e-9, _floor(run))
    for trial in walks:
        places = peers.rts_smoother(trial.acc, trial.gyro, datasets.GAITMAP_HZ)
        if places is not None:
            error = _stride_error_mm(trial, strides[trial.side], trial.t, places[:, :2])
            tables["strides"][trial.name]["RtsKalman (gaitmap), mm"] = error
    return tables


def _runs(trials: list[FootTrial], filter_name: str) -> dict[Side, FootRun]:
    settings = datasets.settings_with(trials, Settings(fusion={"filter": filter_name}))
    return run_filter(datasets.messages(trials, settings), settings)[0]


def _floor(run: FootRun) -> Array:
    """As the references have it: seen from above, the second axis to the left of the first."""
    return np.stack([run.p[:, 0], -run.p[:, 2]], axis=-1)


def _track_error(trial: FootTrial, run: FootRun) -> float:
    places = _at(trial.true_t, run.t * 1e-9, _floor(run))
    return round(datasets.aligned_rmse(places, trial.true_xy), 4)


def _medians(rows: dict[str, dict[str, float | None]]) -> dict[str, float | None]:
    columns = list(dict.fromkeys(name for row in rows.values() for name in row))
    return {name: float(np.median([value for row in rows.values() if (value := row[name])])) for name in columns}


def _returns(trial: FootTrial) -> dict[str, float | None]:
    trial = datasets.levelled(trial)
    row: dict[str, float | None] = {}
    for label, name in FILTERS.items():
        run = _runs([trial], name)[trial.side]
        x, y, z = (1e3 * (run.p[-1] - run.p[0])).tolist()
        row |= {f"{label}, plane": float(np.hypot(x, z)), f"{label}, height": y}
    end = 1e3 * peers.ahrs_with_zero_velocity(trial.t, trial.acc, trial.gyro, XIO_HZ)[-1]
    row |= {"imufusion, plane": float(np.hypot(end[0], end[1])), "imufusion, height": float(end[2])}
    row["imufusion, in all"] = float(np.linalg.norm(end))
    row["published, in all"] = PUBLISHED_RETURN_MM[trial.name]
    return row


def _stands(run: FootRun, ends: Array) -> Flags:
    """Whether a stance was found near each end, shape (n, 2)."""
    stances = run.t[run.contact] * 1e-9
    if not len(stances):
        return np.zeros(ends.shape, dtype=bool)
    after = np.searchsorted(stances, ends).clip(1, len(stances) - 1)
    near: Flags = np.minimum(np.abs(stances[after] - ends), np.abs(stances[after - 1] - ends)) < _STANCE_S
    return near


def _stride_error_mm(trial: FootTrial, ends: Array, t: Array, places: Array) -> float:
    ours = np.diff(_at(ends, t, places), axis=1)
    true = np.diff(_at(ends, trial.true_t, trial.true_xy), axis=1)
    errors = np.linalg.norm(ours, axis=-1) - np.linalg.norm(true, axis=-1)
    return float(1e3 * np.sqrt(np.mean(errors**2)))


def _at(wanted: Array, t: Array, places: Array) -> Array:
    return np.stack([np.interp(wanted, t, places[:, axis]) for axis in range(places.shape[1])], axis=-1)
