"""``foottrack evaluate --gait``: steps, events and an avatar's feet, ours beside the published ways."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

_WIDTH = 140
_ROWS = (
    ("steps", "steps taken"),
    ("found", "found"),
    ("extra", "extra"),
    ("false_in_squats", "false steps in squats"),
    ("false_when_standing", "false steps leaning, turning and looking about"),
    ("lift_latency_ms", "a lifted foot is noticed after, ms (median)"),
    ("correlation", "avatar's foot with the user's: correlation"),
    ("phase_error_ms", "and phase error, ms"),
    ("max_jump_mm", "largest jump of a target in a frame, mm"),
    ("max_move_mm", "largest movement in a frame, mm"),
    ("skate_mm", "largest skate of a stance, mm"),
    ("skate_mm_median", "median skate, mm"),
)


def evaluate_gait(seeds: Sequence[int], real: Path | None = None, *, quiet: bool = False) -> dict[str, Any]:
    """``{"gait": {mode: figures}}`` of simulated people, and with a folder of recordings ``"gait_real"``.

    Runs on all cores, each case in a spawned process. Raises DatasetError for recordings that are not there.
    """
    from foottrack_service.evaluation.gait import run_case, summary
    from foottrack_service.evaluation.gait_cases import cases
    from foottrack_service.evaluation.processes import processes

    wanted = cases(seeds)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    found = []
    with (
        Progress(*columns, console=Console(stderr=True), transient=True, disable=quiet) as progress,
        processes(len(wanted)) as pool,
    ):
        bar = progress.add_task("walking in place", total=len(wanted))
        for figures in pool.map(run_case, wanted):
            found.append(figures)
            progress.update(bar, advance=1, description=figures.case.name)
    results: dict[str, Any] = {"gait": summary(found)}
    if real is not None:
        from foottrack_service.evaluation.gait_real import real_tables

        results["gait_real"] = real_tables(real)
    return results


def show_gait(results: dict[str, Any], console: Console | None = None) -> None:
    """Print the tables."""
    console = console or Console(width=None if sys.stdout.isatty() else _WIDTH)
    for table in gait_tables(results):
        console.print(table, "")


def gait_tables(results: dict[str, Any]) -> list[Table]:
    """Of what ``evaluate_gait`` found."""
    modes: dict[str, dict[str, Any]] = results["gait"]
    table = _table("Walking in place: simulated people, held-out seeds", "", *modes)
    for key, label in _ROWS:
        table.add_row(label, *(_text(figures[key]) for figures in modes.values()))
    others = _table("Walks that began while somebody did something else", "", *modes)
    for kind in next(iter(modes.values()))["false_walks"]:
        others.add_row(kind, *(_text(figures["false_walks"][kind]) for figures in modes.values()))
    speeds = _table("Speed by cadence, m/s", "steps/s", *modes)
    for cadence in modes["ours"]["speed_by_cadence"]:
        speeds.add_row(cadence, *(_text(figures["speed_by_cadence"].get(cadence)) for figures in modes.values()))
    shown = [table, others, speeds]
    events = _table("Ours: instants of events, ms", "event", "bias", "SD")
    for name, figures in modes["ours"].get("events_ms", {}).items():
        events.add_row(name, _text(figures["bias"]), _text(figures["sd"]))
    shown.append(events)
    if "gait_real" in results:
        rows: dict[str, dict[str, Any]] = results["gait_real"]
        names = list(dict.fromkeys(key for row in rows.values() for key in row))
        recordings = _table("Real recordings", "recording", *names)
        for label, row in rows.items():
            recordings.add_row(label, *(_text(row.get(name)) for name in names))
        shown.append(recordings)
    return shown


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    for index, name in enumerate(columns):
        table.add_column(name, justify="right" if index else "left", no_wrap=True)
    return table


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) and abs(value) < 10.0 else f"{value:g}"
