"""``foottrack log``: what can be done with a recording once it is there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.progress import track

from foottrack_service.cli.running import (
    EXIT_FAILED,
    EXIT_USAGE,
    CommandFailed,
    ConfigOption,
    JsonOption,
    UserOption,
    print_json,
)
from foottrack_service.recording.errors import RecordingError

if TYPE_CHECKING:
    from foottrack_service.recording.reader import Frame, Recording

EXIT_DIFFERENT = 1
EXIT_TROUBLE = 2
"""``diff`` ends as diff(1) does: 0 the same, 1 different, 2 trouble."""
EXIT_NOTHING = 1
EXIT_LOSSES = 3

app = typer.Typer(no_args_is_help=True, help="Look into recordings, convert, compare and repair them.")

FileArgument = Annotated[Path, typer.Argument(help="A recording: MCAP, or a bare msgpack stream.")]
TopicOption = Annotated[
    list[str] | None, typer.Option("--topic", "-t", help="Only topics that begin so; may be given several times.")
]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder to write into; nothing there is overwritten.")]
FromOption = Annotated[
    float | None, typer.Option("--from", min=0.0, max=1e9, help="Begin here, s from the first message.")
]
ToOption = Annotated[float | None, typer.Option("--to", min=0.0, max=1e9, help="End here, s from the first message.")]


@app.command()
def info(file: FileArgument, as_json: JsonOption = False) -> None:
    """Topics, rates, gaps, duration, and what the calibration was.

    Example: foottrack log info walk.mcap
    """
    with _readable_errors():
        found = _open(file).info
    if as_json:
        topics = {name: {"hz": entry.hz, **asdict(entry)} for name, entry in found.topics.items()}
        print_json({**asdict(found), "duration_s": found.duration_s, "topics": topics})
    else:
        from foottrack_service.cli.log_text import show_info

        show_info(found)


@app.command()
def cat(
    file: FileArgument,
    topic: TopicOption = None,
    begin: FromOption = None,
    end: ToOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print messages as text, one a line.

    Example: foottrack log cat walk.mcap --topic user/imu --from 2 --to 3
    """
    import json

    from foottrack_service.recording.export import as_map, to_json

    with _readable_errors():
        recording = _open(file)
        first = recording.require_span().first
        for frame in _selected(recording, topic, begin, end):
            if as_json:
                typer.echo(to_json(frame))
                continue
            values = as_map(frame)
            body = json.dumps(values.get("data"), ensure_ascii=False, default=repr)
            flag = "" if values.get("valid") else " INVALID"
            typer.echo(f"{(frame.arrival - first) * 1e-9:12.6f} {values['topic']} {values.get('seq')}{flag} {body}")


@app.command()
def export(
    file: FileArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write; a folder for csv, with a table a topic.")],
    to: Annotated[Literal["msgpack", "csv", "jsonl"], typer.Option("--format", "-f")] = "msgpack",
    topic: TopicOption = None,
    begin: FromOption = None,
    end: ToOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write a recording as a bare msgpack stream, JSON lines, or CSV.

    Example: foottrack log export walk.mcap --format csv --out walk-csv
    """
    from foottrack_service.recording.export import CsvTables, write_jsonl, write_msgpack

    with _readable_errors():
        recording = _open(file)
        try:
            if to == "csv":
                tables = CsvTables(out)
                tables.learn(_selected(recording, topic, begin, end))
                count = tables.write(_progress(_selected(recording, topic, begin, end), "Writing"))
            else:
                frames = _progress(_selected(recording, topic, begin, end), "Writing")
                if to == "msgpack":
                    with out.open("xb") as binary:
                        count = write_msgpack(frames, binary)
                else:
                    with out.open("x", encoding="utf-8") as text:
                        count = write_jsonl(frames, text)
        except ValueError as error:
            raise CommandFailed(f"{file}: {error}") from None
    _done({"messages": count, "out": str(out)}, f"{count} messages in {out}", as_json)


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(help="A bare msgpack stream: maps {topic, log_time, ...envelope}.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The MCAP file to write.")],
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="Settings that the recording shall carry.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Make a recording of a bare msgpack stream.

    Example: foottrack log import walk.msgpack --out walk.mcap
    """
    from foottrack_service.config import load
    from foottrack_service.recording.file import RecordingFile
    from foottrack_service.recording.importer import copy

    with _readable_errors():
        text = None
        if config is not None:
            # Stricter than what a recording carries: a typing error is to be seen now.
            load(config)
            text = config.read_text(encoding="utf-8")
        recording = _open(file)
        with RecordingFile(out, text) as written:
            copy(_progress(recording.frames(), "Importing"), written)
        count = written.messages
    _done({"messages": count, "out": str(out)}, f"{count} messages in {out}", as_json)


@app.command()
def diff(
    a: Annotated[Path, typer.Argument(help="A recording.")],
    b: Annotated[Path, typer.Argument(help="The one to compare with.")],
    absolute: Annotated[float, typer.Option("--abs", min=0.0, help="Floats may differ by so much.")] = 0.0,
    relative: Annotated[float, typer.Option("--rel", min=0.0, help="Floats may differ by this share.")] = 0.0,
    ignore: Annotated[
        list[str] | None, typer.Option("--ignore", help="Leave a field out: sid, t_pub, data.*.sigma; several times.")
    ] = None,
    topic: TopicOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare two recordings field by field, and name the first that differs. Ends with 0 the same, 1 not, 2 trouble.

    Example: foottrack log diff before.mcap after.mcap --abs 1e-9 --ignore sid --ignore log_time
    """
    from foottrack_service.recording.compare import Tolerance, compare

    with _readable_errors(EXIT_TROUBLE):
        one, other = _open(a), _open(b)
        try:
            found = compare(
                _progress(_selected(one, topic, None, None), "Comparing"),
                _selected(other, topic, None, None),
                Tolerance(absolute, relative),
                ignore or (),
            )
        except ValueError as error:
            raise CommandFailed(str(error), EXIT_TROUBLE) from None
    if as_json:
        first = found.first
        place = None if first is None else {"topic": first.topic, "index": first.index, "arrival": first.arrival}
        values = {} if first is None or not first.field else {"field": first.field, "a": first.a, "b": first.b}
        print_json({**asdict(found), "same": found.same, "first": None if place is None else {**place, **values}})
    else:
        from foottrack_service.cli.log_text import show_comparison

        show_comparison(found)
    raise typer.Exit(0 if found.same else EXIT_DIFFERENT)


@app.command()
def recover(
    file: FileArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="The MCAP file to write.")],
    as_json: JsonOption = False,
) -> None:
    """Salvage a torn or damaged recording. Ends with 0 when it was whole, 3 with losses, 1 when there was nothing.

    Example: foottrack log recover walk.mcap.part --out walk.mcap
    """
    from foottrack_service.recording.recover import recover as salvage

    with _readable_errors():
        if not file.exists():
            raise CommandFailed(f"{file}: no such file", EXIT_USAGE)
        report = salvage(file, out)
    if as_json:
        print_json({**asdict(report), "whole": report.whole, "out": str(out) if report.messages else None})
    else:
        from foottrack_service.cli.log_text import show_recovered

        show_recovered(report, out)
    raise typer.Exit(EXIT_NOTHING if not report.messages else 0 if report.whole else EXIT_LOSSES)


@app.command()
def raw(
    file: FileArgument,
    out: OutOption,
    user: UserOption = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Unpack what record --raw has recorded: bytes of the IMUs, and pictures that the folder source plays.

    Writes imu-left.bin (imu-left.csv has each read's time, length and format), camera/ in TUM's layout, and a
    foottrack.toml to play it with. The bytes are decoded again, and counted.

    Example: foottrack log raw trouble.mcap --out trouble
    """
    from foottrack_service.cli.log_raw import unpack

    with _readable_errors():
        unpack(_open(file), out, user, config, as_json)


def _open(file: Path) -> Recording:
    from foottrack_service.recording.reader import open_recording

    return open_recording(file)


@contextmanager
def _readable_errors(code: int = EXIT_FAILED) -> Iterator[None]:
    try:
        yield
    except RecordingError as error:
        hint = "" if not error.offset else "; `foottrack log recover` brings what is whole"
        raise CommandFailed(f"{error}{hint}", code) from None
    except BrokenPipeError:
        raise
    except OSError as error:
        raise CommandFailed(f"{error.filename or ''}: {error.strerror or error}", code) from None


def _selected(
    recording: Recording, topics: list[str] | None, begin: float | None, end: float | None
) -> Iterator[Frame]:
    prefixes = tuple(topic.encode() for topic in topics or ())
    since = until = None
    if begin is not None or end is not None:
        first = recording.require_span().first
        since = None if begin is None else first + round(begin * 1e9)
        until = None if end is None else first + round(end * 1e9)
    for frame in recording.frames(since):
        if until is not None and frame.arrival > until:
            return
        if not prefixes or frame.topic.startswith(prefixes):
            yield frame


def _progress(items: Iterator[Any], label: str) -> Iterator[Any]:
    console = Console(stderr=True)
    yield from track(items, label, console=console, transient=True, disable=not console.is_terminal)


def _done(values: dict[str, Any], text: str, as_json: bool) -> None:
    if as_json:
        print_json(values)
    else:
        typer.echo(text)
