"""Pictures of errors over time, and one page with all of it."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from foottrack_protocol.frames import SIDES
from foottrack_service.config import Settings
from foottrack_service.evaluation.jobs import FILTERS, FilterName, Job, ScenarioTruth, compare, scenario_of
from foottrack_service.evaluation.run import STAGES, FootRun, Truth, run_filter
from foottrack_service.rotations import Array

_STAGE_COLOURS = ("#cfe8cf", "#cfdcf2", "#fdf0c8", "#f7d9c0", "#f2c4c4")
_FILTER_COLOURS: dict[FilterName, str] = {"reference": "#b0413e", "ours": "#1f4e9c"}
_AXES = ("x (right)", "y (up)", "z (back)")
_CLIP_MM = 150.0


def task_pictures(task: str, seed: int) -> dict[str, bytes]:
    """For each foot one PNG of a simulated task, through both filters; by file name."""
    found: dict[str, list[tuple[FilterName, FootRun, Array, Array]]] = {side: [] for side in SIDES}
    seconds: dict[str, Any] = {}
    for name, value in FILTERS.items():
        settings = Settings(fusion={"filter": value})
        scenario = scenario_of(Job(task, seed, name), settings)
        runs, _ = run_filter(scenario.messages(), settings)
        for side in SIDES:
            truth = ScenarioTruth(scenario, side)
            arm = np.array(settings.feet.of(side).marker.p) if name == "reference" else np.zeros(3)
            found[side].append(_compared(name, runs[side], truth, arm))
            seconds[side] = truth.seconds
    return {
        f"{task}-{side}.png": _picture(f"{task}, {side} foot, seed {seed}", tracks, seconds[side])
        for side, tracks in found.items()
    }


def recording_pictures(file: Path) -> dict[str, bytes]:
    """The same for a recording with truth. Raises RecordingError."""
    from foottrack_service.evaluation.recorded import recorded_runs

    found: dict[str, list[tuple[FilterName, FootRun, Array, Array]]] = {}
    zero = 0
    for name, value in FILTERS.items():
        runs, truths, settings = recorded_runs(file, value)
        for side, truth in truths.items():
            zero = int(truth.t[0])
            arm = np.array(settings.feet.of(side).marker.p) if name == "reference" else np.zeros(3)
            found.setdefault(side, []).append(_compared(name, runs[side], truth, arm))
    return {
        f"{file.stem}-{side}.png": _picture(f"{file.name}, {side} foot", tracks, lambda t: (t - zero) * 1e-9)
        for side, tracks in found.items()
    }


def page(tables: str, pictures: dict[str, bytes]) -> str:
    """One HTML page that needs nothing else. ``tables`` is text in fixed width."""
    shown = "\n".join(
        f'<h2>{html.escape(name)}</h2><img alt="{html.escape(name)}" '
        f'src="data:image/png;base64,{base64.b64encode(png).decode()}">'
        for name, png in pictures.items()
    )
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>foottrack evaluation</title>'
        "<style>body{font:15px sans-serif;margin:2em}pre{font:13px monospace;overflow-x:auto}"
        "img{max-width:100%}</style>"
        f"<h1>foottrack evaluation</h1><pre>{html.escape(tables)}</pre>{shown}</html>\n"
    )


def _compared(name: FilterName, run: FootRun, truth: Truth, arm: Array) -> tuple[FilterName, FootRun, Array, Array]:
    run = run.cut(truth.covers(run.t) & ~np.isnan(run.age))
    estimate, true = compare(run, truth, arm)
    return name, run, estimate, true


def _picture(title: str, tracks: Sequence[tuple[FilterName, FootRun, Array, Array]], seconds: Any) -> bytes:
    mpl.use("Agg")
    figure = Figure(figsize=(13, 9), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True)
    figure.suptitle(title)
    ours = next((track for track in tracks if track[0] == "ours"), tracks[0])
    for axis in axes:
        _shade(axis, seconds(ours[1].t), ours[1].stage)
        axis.grid(alpha=0.3)
    for name, run, estimate, true in tracks:
        error = 1e3 * (estimate - true)
        when = seconds(run.t)
        for index in range(3):
            axes[index].plot(when, np.clip(error[:, index], -_CLIP_MM, _CLIP_MM), lw=0.8, color=_FILTER_COLOURS[name])
            axes[index].set_ylabel(f"{_AXES[index]}, mm")
        distance = np.minimum(np.linalg.norm(error, axis=1), _CLIP_MM)
        axes[3].plot(when, distance, lw=0.8, color=_FILTER_COLOURS[name], label=name)
        if name == "ours":
            axes[3].plot(
                when, np.minimum(1e3 * run.sigma, _CLIP_MM), lw=0.8, ls=":", color="k", label="sigma announced"
            )
    axes[3].set_ylabel(f"distance, mm (clipped at {_CLIP_MM:.0f})")
    axes[3].set_xlabel("s; background: stage of our filter")
    for stage, colour in zip(STAGES, _STAGE_COLOURS, strict=True):
        axes[3].fill_between([], [], color=colour, label=stage)
    axes[3].legend(loc="upper right", ncols=4, fontsize=8)
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return out.getvalue()


def _shade(axis: Any, seconds: Array, stage: Array) -> None:
    if len(seconds) < 2:
        return
    gap = np.diff(seconds) > 0.1
    edges = np.concatenate([[0], 1 + np.flatnonzero((np.diff(stage) != 0) | gap), [len(stage)]])
    for begin, end in pairwise(edges):
        # A hole in the outputs stays white.
        stop = end if end < len(seconds) and not gap[end - 1] else end - 1
        axis.axvspan(seconds[begin], seconds[stop], color=_STAGE_COLOURS[int(stage[begin])], lw=0)
