"""``foottrack evaluate``: how good the filters are, beside the published system."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.status import Status
from rich.table import Table

from foottrack_service.cli.evaluate_faults import fault_recovery_table
from foottrack_service.cli.running import EXIT_USAGE, CommandFailed, JsonOption, print_json

_WIDTH = 140
_FIGURES = ("mean", "median", "p95", "max")
_SIGMA_DUE = "sigma is the radius of the ball of 68 %: 68.3, 99.7 and 100.0 % are due within 1, 2 and 3 of it"
"""Of an isotropic normal error: chi-square with 3 degrees of freedom at 3.5267 times 1, 4 and 9."""
_REAL_TITLES = {
    "tracks": "Real walks and runs against motion capture, rms on the floor, m",
    "returns": "Real walks that end where they began: where they end, mm",
    "strides": "Real strides: length against the heel's marker, rms",
}
DEFAULT_SECTIONS = ("tasks", "technical", "study")


def evaluate(
    file: Annotated[
        Path | None, typer.Argument(help="A recording that carries truth/left or truth/right; simulations if absent.")
    ] = None,
    tasks: Annotated[str | None, typer.Option("--tasks", help="Some tasks only, with commas between.")] = None,
    seeds: Annotated[str, typer.Option("--seeds", help="Seeds of the simulations, with commas between.")] = "1,2",
    sections: Annotated[
        str | None,
        typer.Option(
            "--sections",
            help="Of tasks, technical, study, variants, gaps, covered, faults; or all."
            f" {','.join(DEFAULT_SECTIONS)} if absent, and tasks alone with --camera rendered.",
        ),
    ] = None,
    camera: Annotated[
        str,
        typer.Option(
            "--camera", help="simulated (finds made up), or rendered: found in drawn pictures, half real time a core."
        ),
    ] = "simulated",
    real: Annotated[
        Path | None,
        typer.Option(
            "--real",
            help="Instead: real recordings of foot-worn IMUs in this folder, beside peers (gaitmap: extra `peers`).",
        ),
    ] = None,
    gait: Annotated[
        bool, typer.Option("--gait", help="Instead: walking in place; with --real also recordings of real steps.")
    ] = False,
    plot: Annotated[Path | None, typer.Option("--plot", help="Draw error over time into this folder (PNG).")] = None,
    html: Annotated[Path | None, typer.Option("--html", help="Write one page with tables and pictures.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Errors, lag, jitter and skate of our filter and of the published one, with the published figures.

    Examples: foottrack evaluate --tasks walk,still --seeds 7,8,9; foottrack evaluate session.mcap --plot out;
    foottrack evaluate --camera rendered --seeds 1
    """
    if camera not in ("simulated", "rendered"):
        raise CommandFailed(f"--camera is simulated or rendered, not {camera!r}", EXIT_USAGE)
    if html is not None and not html.parent.is_dir():
        raise CommandFailed(f"--html {html}: there is no folder {html.parent}", EXIT_USAGE)
    sections = sections or ("tasks" if camera == "rendered" else ",".join(DEFAULT_SECTIONS))
    if gait:
        from foottrack_service.cli.evaluate_gait import evaluate_gait, show_gait

        found = evaluate_gait(_chosen_seeds(seeds), real, quiet=as_json)
        if as_json:
            print_json(found)
        else:
            show_gait(found)
        return
    if real is not None:
        from foottrack_service.evaluation.real import real_tables

        with Status("reading", console=Console(stderr=True)) as shown:
            results: dict[str, Any] = {"real": real_tables(real, shown.update)}
    elif file is not None:
        from foottrack_service.evaluation.recorded import recorded_tables

        results = {"tasks": {file.stem: recorded_tables(file)}}
    else:
        chosen = _chosen_sections(sections)
        results = _simulated(_chosen_tasks(tasks), _chosen_seeds(seeds), chosen, camera, as_json)
    if plot is not None or html is not None:
        _draw(results, file, _chosen_tasks(tasks), _chosen_seeds(seeds)[0], plot, html)
    if as_json:
        print_json(results)
    else:
        show(results)


def show(results: dict[str, Any], console: Console | None = None) -> None:
    """Print all tables."""
    from foottrack_service.evaluation.published import NOTES

    console = console or Console(width=None if sys.stdout.isatty() else _WIDTH)
    for table in _as_tables(results):
        console.print(table, "")
    if "technical" in results:
        console.print("Why a row differs from the published one:")
        for task, note in NOTES.items():
            console.print(f"  {task}: {note}")


def _draw(
    results: dict[str, Any], file: Path | None, tasks: list[str], seed: int, plot: Path | None, html: Path | None
) -> None:
    from foottrack_service.evaluation.plots import page, recording_pictures, task_pictures

    pictures: dict[str, bytes] = {}
    if file is not None:
        pictures = recording_pictures(file)
    elif "real" not in results:
        with Progress(console=Console(stderr=True), transient=True) as progress:
            for task in progress.track(tasks, description="drawing"):
                pictures.update(task_pictures(task, seed))
    if plot is not None:
        plot.mkdir(parents=True, exist_ok=True)
        for name, png in pictures.items():
            (plot / name).write_bytes(png)
        typer.echo(f"Drew {len(pictures)} pictures into {plot}.", err=True)
    if html is not None:
        text = io.StringIO()
        show(results, Console(file=text, width=_WIDTH))
        html.write_text(page(text.getvalue(), pictures), encoding="utf-8")
        typer.echo(f"Wrote {html}.", err=True)


def _simulated(tasks: list[str], seeds: list[int], sections: list[Any], camera: Any, quiet: bool) -> dict[str, Any]:
    from foottrack_service.evaluation.fault_recovery import FAULT_TASKS, fault_jobs, fault_table, run_fault_jobs
    from foottrack_service.evaluation.sections import jobs_of, run_jobs, tables

    faults = fault_jobs(tasks, seeds) if "faults" in sections else []
    if "faults" in sections and not faults:
        raise CommandFailed(f"faults happen in {', '.join(FAULT_TASKS)}; none of them was chosen", EXIT_USAGE)
    sections = [section for section in sections if section != "faults"]
    jobs = [job for section in sections for job in jobs_of(section, tasks, seeds, camera)]
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=quiet) as progress:
        bar = progress.add_task("simulating and fusing", total=len(set(jobs)) + len(faults))
        results = run_jobs(jobs, lambda done: progress.update(bar, advance=1, description=done.job.task))
        recoveries = run_fault_jobs(faults, lambda task: progress.update(bar, advance=1, description=task))
    found: dict[str, Any] = {section: tables(section, results, tasks, seeds, camera) for section in sections}
    found.setdefault("tasks", {})
    if faults:
        found["faults"] = fault_table(recoveries)
    return found


def _chosen_tasks(text: str | None) -> list[str]:
    from foottrack_service.evaluation.sections import all_tasks

    known = all_tasks()
    chosen = known if text is None else [name.strip() for name in text.split(",") if name.strip()]
    for name in chosen:
        if name not in known:
            raise CommandFailed(f"no task is called {name!r}; there are: {', '.join(known)}", EXIT_USAGE)
    return chosen


def _chosen_seeds(text: str) -> list[int]:
    try:
        chosen = [int(part) for part in text.split(",") if part.strip()]
        if not chosen or min(chosen) < 0:
            raise ValueError
    except ValueError:
        raise CommandFailed(
            f"--seeds takes whole numbers from 0 with commas between, not {text!r}", EXIT_USAGE
        ) from None
    return chosen


def _chosen_sections(text: str) -> list[Any]:
    from foottrack_service.evaluation.sections import SECTIONS

    known = (*SECTIONS, "faults")
    if text == "all":
        return list(known)
    chosen = [name.strip() for name in text.split(",") if name.strip()]
    for name in chosen:
        if name not in known:
            raise CommandFailed(f"no section is called {name!r}; there are: {', '.join(known)}, all", EXIT_USAGE)
    return chosen


def _as_tables(results: dict[str, Any]) -> list[Table]:
    shown = []
    if results.get("tasks"):
        shown.append(_task_table("Error of the foot, mm; lag, ms (100 Hz, mild feet)", results["tasks"]))
    if _filters(results.get("tasks", {})):
        shown += [_fix_table(results["tasks"]), _centre_table(results["tasks"])]
    for label, rows in results.get("variants", {}).items():
        shown.append(_task_table(f"The same, {label}", rows))
    if "covered" in results:
        shown.append(_task_table("The same, tags covered after 3 s: depth alone shows the shoes", results["covered"]))
    if "technical" in results:
        shown.append(_technical_table(results["technical"]))
    if "study" in results:
        shown.append(_study_table(results["study"]))
    if "gaps" in results:
        shown.append(_gap_table(results["gaps"]))
    if "faults" in results:
        shown.append(fault_recovery_table(results["faults"]))
    if "real" in results:
        for name, title in _REAL_TITLES.items():
            shown.append(_plain_table(title, results["real"][name]))
    return shown


def _task_table(title: str, rows: dict[str, Any]) -> Table:
    table = Table(title=title, title_justify="left", caption=_SIGMA_DUE, caption_justify="left")
    for name in ("task", "filter"):
        table.add_column(name, no_wrap=True)
    for name in (*_FIGURES, "lag", "jitter", "skate", "in 1, 2, 3 sigma"):
        table.add_column(name, justify="right", no_wrap=True)
    for task, row in rows.items():
        for index, (name, values) in enumerate(row.items()):
            shares = values.get("within_sigma") or {}
            table.add_row(
                task if index == 0 else "",
                name,
                *(_text(values.get(key)) for key in (*_FIGURES, "lag", "jitter", "skate")),
                " ".join(f"{100 * share:.0f}" for share in shares.values()),
                end_section=index == len(row) - 1,
            )
    return table


def _fix_table(rows: dict[str, Any]) -> Table:
    table = Table(title="Optical fixes, per cent", title_justify="left")
    for name in ("task", "filter"):
        table.add_column(name, no_wrap=True)
    for name in ("false ones rejected", "good ones lost"):
        table.add_column(name, justify="right")
    for task, name, values in _filters(rows):
        table.add_row(task, name, _text(values["false_rejected"]), _text(values["good_lost"]))
    return table


def _centre_table(rows: dict[str, Any]) -> Table:
    table = Table(title="Mean / p95 error by the tag's distance from the picture's centre, mm", title_justify="left")
    for name in ("task", "filter"):
        table.add_column(name, no_wrap=True)
    for index, (task, name, values) in enumerate(_filters(rows)):
        bins = values["by_centre_px"]
        for label in bins if index == 0 else ():
            table.add_column(f"{label} px", justify="right", no_wrap=True)
        table.add_row(task, name, *(f"{_text(each['mean'])} / {_text(each['p95'])}" for each in bins.values()))
    return table


def _filters(rows: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    """Rows of the filters that were run, without bounds and publications."""
    return [
        (task, name, values) for task, row in rows.items() for name, values in row.items() if "by_centre_px" in values
    ]


def _technical_table(rows: dict[str, Any]) -> Table:
    table = Table(title="[B]'s technical tests by the source that is left, mm; [B]'s latency, ms", title_justify="left")
    for name in ("test", "source", "filter"):
        table.add_column(name, no_wrap=True)
    for name in ("mean", "max", "onset to peak", "true lag"):
        table.add_column(name, justify="right", no_wrap=True)
    for task, sources in rows.items():
        for source, row in sources.items():
            for index, (name, values) in enumerate(row.items()):
                cells = (_text(values.get(key)) for key in ("mean", "max", "peak_delay", "lag"))
                table.add_row(task, source, name, *cells, end_section=index == len(row) - 1)
    return table


def _study_table(rows: dict[str, Any]) -> Table:
    table = Table(title="[B]'s user study, the left foot without IMU, mm", title_justify="left")
    for name in ("task", "foot", "filter"):
        table.add_column(name, no_wrap=True)
    for name in _FIGURES:
        table.add_column(name, justify="right")
    for task, sides in rows.items():
        for side, row in sides.items():
            for index, (name, values) in enumerate(row.items()):
                cells = (_text(values.get(key)) for key in _FIGURES)
                table.add_row(task, side, name, *cells, end_section=index == len(row) - 1)
    return table


def _gap_table(rows: dict[str, Any]) -> Table:
    table = Table(title="Error at the end of a dark camera's gap in a walk, mm", title_justify="left")
    for name in ("gap, s", "filter", "median", "p90"):
        table.add_column(name, justify="right")
    for gap, row in rows.items():
        for name, values in row.items():
            table.add_row(gap, name, _text(values["median"]), _text(values["p90"]))
    return table


def _plain_table(title: str, rows: dict[str, dict[str, Any]]) -> Table:
    table = Table(title=title, title_justify="left")
    names = list(dict.fromkeys(key for row in rows.values() for key in row))
    for name in ("recording", *names):
        table.add_column(name, justify="left" if name == "recording" else "right")
    for label, row in rows.items():
        table.add_row(label, *(_text(row.get(name)) for name in names))
    return table


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.1f}" if abs(value) >= 10.0 else f"{value:.2f}"
    return str(value)
