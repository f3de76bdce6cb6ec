"""The gait on public recordings: events against motion capture, counted strides, steps from a headset alone."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.evaluation import datasets
from foottrack_service.evaluation.gait_metrics import Matched, match
from foottrack_service.evaluation.gait_runs import GaitRun, Instant, feet_of, run_gait
from foottrack_service.gait.samples import HeadSample
from foottrack_service.rotations import Array

_EVENT_TOLERANCE_S = 0.25
_SWING_SPEED = 0.5
"""m/s of a heel's marker over the floor: faster is a swing."""
_LEAST_SWING_S = 0.15
_WINDOW_S = 4.0
_SLOW_S = 0.9
"""What changes over longer than this is no bob."""
_LEAST_REGULAR = 0.5
"""Autocorrelation of a window in which somebody bobs steadily."""


class GaitmapEvents(NamedTuple):
    """One foot of the gaitmap walk."""

    strikes: Matched
    toe_offs: Matched
    """Both against the listed strides' events."""
    missed_swings: int
    extra_swings: int
    """Against all swings of the heel's marker: the list leaves out first, last and turning ones."""


def gaitmap_events(folder: Path) -> dict[Side, GaitmapEvents]:
    """Both feet. Raises DatasetError."""
    trials = [datasets.levelled(trial) for trial in datasets.gaitmap(folder)]
    settings = datasets.settings_with(trials, Settings())
    run = run_gait(feet_of(datasets.messages(trials, settings), settings), settings)
    listed = _stride_events(folder / "stride_events_sample.csv")
    found: dict[Side, GaitmapEvents] = {}
    for trial in trials:
        side = trial.side
        strikes, leaves = (_times(run, side, name) for name in ("foot_strike", "toe_off"))
        swings = _swings(trial.marks["heel"])
        mocap = match(swings, strikes, 0.5)
        found[side] = GaitmapEvents(
            _listed_only(match(listed[side]["ic"], strikes, _EVENT_TOLERANCE_S)),
            _listed_only(match(listed[side]["tc"], leaves, _EVENT_TOLERANCE_S)),
            mocap.true - mocap.found,
            mocap.extra,
        )
    return found


def corridor_strides(file: Path) -> tuple[int, int]:
    """Strides that were counted, and strides that were found. Raises DatasetError."""
    trial, strides = datasets.corridor(file)
    trial = datasets.levelled(trial)
    settings = datasets.settings_with([trial], Settings())
    run = run_gait(feet_of(datasets.messages([trial], settings), settings), settings)
    return strides, len(_times(run, "right", "foot_strike"))


def quest_cadence(file: Path) -> list[tuple[float, float] | None]:
    """(bob's frequency, pace of the steps), Hz, in each window of 4 s; None where the head does not bob steadily.

    Windows overlap by half. A pause is no reason to leave one out. Raises DatasetError.
    """
    trace = datasets.quest(file)
    instants = [
        Instant(round(t * 1e9), None, None, HeadSample((p[0], p[1], p[2]), (q[0], q[1], q[2], q[3])))
        for t, p, q in zip(trace.t.tolist(), trace.p.tolist(), trace.q.tolist(), strict=True)
    ]
    run = run_gait(instants, Settings())
    steps = np.sort(np.concatenate([_times(run, side, "toe_off") for side in SIDES]))
    bobs, rate = bobs_of(trace.t, trace.p[:, 1])
    pairs: list[tuple[float, float] | None] = []
    for begin in np.arange(0.0, trace.t[-1] - _WINDOW_S, 0.5 * _WINDOW_S):
        window = (trace.t >= begin) & (trace.t < begin + _WINDOW_S)
        bob = bob_hz(bobs[window], rate)
        inside = steps[(steps >= begin) & (steps < begin + _WINDOW_S)]
        # The median: somebody who paused within the window did not step more slowly.
        pace = 1.0 / float(np.median(np.diff(inside))) if len(inside) > 2 else 0.0
        pairs.append(None if bob is None else (bob, pace))
    return pairs


def real_tables(folder: Path) -> dict[str, dict[str, Any]]:
    """One row per recording. Raises DatasetError."""
    table: dict[str, dict[str, Any]] = {}
    for side, found in gaitmap_events(folder / "gaitmap").items():
        for name, matched in (("strikes", found.strikes), ("toe-offs", found.toe_offs)):
            table[f"gaitmap {side} {name}"] = {
                "true": matched.true,
                "found": matched.found,
                "extra": found.extra_swings,
                "bias, ms": round(1e3 * float(np.mean(matched.errors)), 1),
                "SD, ms": round(1e3 * float(np.std(matched.errors)), 1),
            }
    for file in sorted((folder / "llio_corridor_dev").glob("*.npz")):
        true, strides = corridor_strides(file)
        table[f"corridor {file.stem.rpartition('_')[2]} strides"] = {"true": true, "found": strides}
    for file in sorted((folder / "quest_wip").glob("walk*.oqrec")):
        windows = quest_cadence(file)
        errors = [abs(pair[0] - pair[1]) for pair in windows if pair is not None]
        table["quest, headset alone"] = {
            "windows": len(windows),
            "bobbing steadily": len(errors),
            "within 0.1 Hz": sum(error <= 0.1 for error in errors),
            "largest error, Hz": max(errors, default=None),
        }
    return table


def _listed_only(matched: Matched) -> Matched:
    """Swings beside the list are judged by the markers."""
    return Matched(matched.true, matched.errors, 0)


def _times(run: GaitRun, side: Side, name: str) -> Array:
    return np.array([event.t for event in run.events if event.side == side and event.name == name])


def _stride_events(file: Path) -> dict[Side, dict[str, Array]]:
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
        return {
            side: {
                key: np.array([float(row[key]) for row in rows if row["foot"] == side]) / datasets.GAITMAP_HZ
                for key in ("ic", "tc")
            }
            for side in SIDES
        }
    except (OSError, KeyError, ValueError) as error:
        raise datasets.DatasetError(f"{file}: {error}") from None


def _swings(heel: Array) -> Array:
    """When the marker's swings end, s; ``heel`` (n, 3) m, z up."""
    speed = np.linalg.norm(np.gradient(heel[:, :2], axis=0), axis=1) * datasets.GAITMAP_MOCAP_HZ
    edges = np.flatnonzero(np.diff(np.concatenate([[False], speed > _SWING_SPEED, [False]]).astype(int)))
    begins, ends = edges[::2] / datasets.GAITMAP_MOCAP_HZ, edges[1::2] / datasets.GAITMAP_MOCAP_HZ
    return np.asarray(ends[ends - begins > _LEAST_SWING_S])


def bobs_of(t: Array, height: Array) -> tuple[Array, float]:
    """What is left of a head's height (n,) m without its slow movements, and samples per s.

    Of the whole trace: of a window alone, half a second at both of its ends would have none of its neighbours.
    """
    rate = float((len(t) - 1) / (t[-1] - t[0]))
    width = 2 * round(0.5 * _SLOW_S * rate) + 1
    slow = np.convolve(np.pad(height, width // 2, mode="edge"), np.ones(width) / width, "valid")
    return height - slow, rate


def bob_hz(y: Array, rate: float) -> float | None:
    """Frequency of a steady bob by its autocorrelation, refined by a parabola; None where it is not steady."""
    own = np.correlate(y, y, "full")[len(y) - 1 :] / np.arange(len(y), 0, -1)
    low, high = int(rate / 3.2), int(rate / 1.3)
    best = low + int(np.argmax(own[low:high]))
    if own[best] < _LEAST_REGULAR * own[0] or not low < best < high - 1:
        return None
    before, at, after = own[best - 1 : best + 2]
    return float(rate / (best + 0.5 * (before - after) / (before - 2.0 * at + after)))
