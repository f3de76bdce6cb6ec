"""What ``foottrack log`` shows to a person."""

from __future__ import annotations

import datetime
from pathlib import Path

import typer
from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Column, Table

from foottrack_service.recording.compare import Comparison
from foottrack_service.recording.info import RecordingInfo, TopicInfo
from foottrack_service.recording.recover import Recovered

_MOST_FIELDS = 20
_WIDEST = 10_000


def show_info(found: RecordingInfo) -> None:
    """A line on the whole, a table of topics, and the calibration."""
    console = Console()
    begun = ""
    if found.begun_unix_ns is not None:
        moment = datetime.datetime.fromtimestamp(found.begun_unix_ns * 1e-9, datetime.UTC).astimezone()
        begun = f", begun {moment:%Y-%m-%d %H:%M:%S}"
    settings = "carries its settings" if found.has_config else "carries no settings"
    each = f" ({found.file_bytes / found.messages:.0f} bytes a message)" if found.messages else ""
    size = f"{found.file_bytes / 1e6:.2f} MB{each}"
    console.print(f"{found.path}: {found.format}, {size}{begun}, {settings}", soft_wrap=True)
    console.print(f"{found.messages} messages in {found.duration_s:.1f} s")
    table, width = _topics(found, console)
    # rich cuts what is wider than its console; a terminal wraps it.
    Console(width=max(width, console.width)).print(table)
    for name, values in sorted(found.calibration.items()):
        console.print(f"calibration {name}: {values}", soft_wrap=True)


def show_comparison(found: Comparison) -> None:
    """The first divergence, and how much each field moved."""
    if found.first is None:
        typer.echo(f"The same: {found.compared} messages.")
        return
    typer.echo(f"First difference: {found.first}")
    typer.echo(f"{found.compared} messages compared, {found.only_a} only in A, {found.only_b} only in B")
    worst = sorted(found.moved.items(), key=lambda item: -item[1].messages)
    for name, moves in worst[:_MOST_FIELDS]:
        typer.echo(f"  {name}: {moves.messages} messages, by at most {moves.largest:.6g}")
    if len(worst) > _MOST_FIELDS:
        typer.echo(f"  and {len(worst) - _MOST_FIELDS} fields more")


def show_recovered(report: Recovered, out: Path) -> None:
    """What was salvaged, and what was lost."""
    for offset, detail in report.damage:
        typer.echo(f"byte {offset}: {detail}" if offset is not None else detail)
    if not report.messages:
        typer.echo("Nothing could be recovered.")
        return
    assert report.first is not None and report.last is not None
    settings = "" if report.has_config else ", without settings"
    typer.echo(f"{report.messages} messages, {(report.last - report.first) * 1e-9:.1f} s, in {out}{settings}")
    if report.whole:
        typer.echo("The recording was whole.")
        return
    lost = "unknown (what came after the last flush)" if report.lost_messages is None else str(report.lost_messages)
    typer.echo(f"Lost: messages {lost}; {report.lost_bytes} bytes of the file; {report.gaps} messages missing by seq")


def _topics(found: RecordingInfo, console: Console) -> tuple[Table, int]:
    """As many columns as there is room for, so that no name and no number is cut; and the width that they need."""
    columns = (
        Column("messages", no_wrap=True, justify="right"),
        Column("Hz", no_wrap=True, justify="right"),
        Column("lost", no_wrap=True, justify="right"),
        Column("invalid"),
        Column("gap, ms", no_wrap=True, justify="right"),
        Column("from"),
    )
    count = len(columns)
    while True:
        table = Table(Column("topic", no_wrap=True), *(column.copy() for column in columns[:count]), box=box.SIMPLE)
        for name, entry in sorted(found.topics.items()):
            table.add_row(name, *_cells(entry)[:count])
        width = Measurement.get(console, console.options.update(max_width=_WIDEST), table).minimum
        if width <= console.width or count == 1:
            return table, width
        count -= 1


def _cells(entry: TopicInfo) -> tuple[str, ...]:
    hz = "" if entry.hz is None else f"{entry.hz:.1f}"
    bad = entry.invalid + sum(entry.undecodable.values())
    reasons = "".join(f" {reason} {count}" for reason, count in entry.undecodable.items())
    gap = f"{entry.longest_gap_s * 1e3:.1f}"
    return str(entry.messages), hz, str(entry.lost), f"{bad}{reasons}", gap, ", ".join(entry.sources)
