"""``foottrack record`` and ``foottrack replay``."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.status import Status

from foottrack_service.cli.joining import joined
from foottrack_service.cli.running import (
    EXIT_USAGE,
    CommandFailed,
    ConfigOption,
    ConnectOption,
    UserOption,
    run_loop,
    settings_for,
)
from foottrack_service.config import Settings

if TYPE_CHECKING:
    from foottrack_service.bus.connection import Bus
    from foottrack_service.recording.live_replay import LiveReplay
    from foottrack_service.recording.writer import RecordingWriter

_REDRAW_S = 0.25


def record(
    file: Annotated[Path, typer.Argument(help="The recording to write, .mcap.")],
    seconds: Annotated[float | None, typer.Option("--seconds", min=0.1, help="End after so long.")] = None,
    raw: Annotated[
        bool,
        typer.Option(
            "--raw",
            help="With the sensors' own bytes, and 5 pictures a second (about 160 MB a minute, of the room too).",
        ),
    ] = False,
    config: ConfigOption = None,
    connect: ConnectOption = None,
) -> None:
    """Record everything on a running bus until Ctrl-C, which closes the file properly.

    With --raw, trouble with a sensor can be looked into later: see foottrack log raw.

    Examples: foottrack record walk.mcap --seconds 60; foottrack record trouble.mcap --raw
    """
    settings = settings_for(config, None, connect)
    with contextlib.suppress(KeyboardInterrupt):
        run_loop(_record(settings, file, seconds, raw))


def replay(
    file: Annotated[Path, typer.Argument(help="A recording: MCAP, or a bare msgpack stream.")],
    offline: Annotated[
        bool, typer.Option("--offline", help="Through fusion without a bus, as fast as possible.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="With --offline: the results, as another recording.")
    ] = None,
    config: ConfigOption = None,
    rate: Annotated[float, typer.Option("--rate", min=0.01, max=1000.0, help="Times the recorded pace.")] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end.")] = False,
    results: Annotated[
        bool, typer.Option("--results", help="Publish recorded results, too, instead of measurements alone.")
    ] = False,
    user: UserOption = None,
    connect: ConnectOption = None,
) -> None:
    """Play a recording on a running bus, or through fusion offline.

    Live, measurements are published as if they happened now, and the service fuses them anew. Keys: space pauses,
    left and right arrow go 5 s back and on, + and - change the pace, q ends it.

    Examples: foottrack replay walk.mcap --rate 2; foottrack replay walk.mcap --offline --out results.mcap
    """
    if offline:
        if out is None:
            raise CommandFailed("--offline needs --out FILE for the results", EXIT_USAGE)
        from foottrack_service.cli.offline import replay_offline

        count = replay_offline(file, out, config)
        typer.echo(f"Wrote {out}: {count} messages.", err=True)
        return
    if out is not None:
        raise CommandFailed("--out goes with --offline", EXIT_USAGE)
    settings = settings_for(config, None, connect)
    try:
        run_loop(_replay(settings, file, rate, loop, results, user))
    except KeyboardInterrupt:
        typer.echo("Stopped.", err=True)


async def _record(settings: Settings, file: Path, seconds: float | None, raw: bool) -> None:
    from foottrack_service.recording import node

    started: asyncio.Future[RecordingWriter] = asyncio.get_running_loop().create_future()
    async with joined(settings) as bus:
        task = asyncio.ensure_future(node.run(bus, settings, file, raw=raw, on_started=started.set_result))
        shown = asyncio.ensure_future(_show_recording(started, file))
        try:
            await asyncio.wait({task}, timeout=seconds)
        finally:
            shown.cancel()
            task.cancel()
            await asyncio.wait({task, shown})
            if started.done() and (task.cancelled() or task.exception() is None):
                stats = started.result().stats
                typer.echo(f"Wrote {file}: {stats.written} messages, {stats.dropped} dropped.", err=True)
        if not task.cancelled():
            task.result()


async def _show_recording(started: asyncio.Future[RecordingWriter], file: Path) -> None:
    writer = await asyncio.shield(started)
    loop = asyncio.get_running_loop()
    began = loop.time()
    with Status(f"recording {file}", console=Console(stderr=True)) as status:
        while True:
            await asyncio.sleep(_REDRAW_S)
            stats = writer.stats
            status.update(
                f"recording {file}: {loop.time() - began:.0f} s, {stats.written} messages, {stats.dropped} dropped, "
                f"{stats.file_bytes / 1e6:.1f} MB. Ctrl-C ends it."
            )


async def _replay(settings: Settings, file: Path, rate: float, loop: bool, results: bool, user: str | None) -> None:
    # All before the first message is due: an import in the running loop would hold it up.
    from foottrack_protocol.topics import Role
    from foottrack_service.bus import control  # noqa: F401
    from foottrack_service.cli import keys  # noqa: F401
    from foottrack_service.recording.play import play
    from foottrack_service.recording.reader import open_recording

    recording = open_recording(file)
    left_out = {Role.SYSTEM, Role.RAW} | (set() if results else {Role.RESULT})
    roles = [role for role in Role if role not in left_out]
    running = asyncio.get_running_loop()
    started: asyncio.Future[LiveReplay] = running.create_future()
    async with joined(settings) as bus:
        task = asyncio.ensure_future(
            play(bus, recording, rate=rate, loop=loop, user=user, roles=roles, on_started=started.set_result)
        )
        attended = asyncio.ensure_future(_attend(bus, started, task, file))
        try:
            await asyncio.wait({task})
        finally:
            for each in (task, attended):
                each.cancel()
            await asyncio.wait({task, attended})
        if task.cancelled() or task.exception() is None:
            typer.echo(f"Published {started.result().status.published} messages of {file}.", err=True)
        else:
            task.result()


async def _attend(bus: Bus, started: asyncio.Future[LiveReplay], task: asyncio.Future[Any], file: Path) -> None:
    """Keys, the control socket and a line of progress, while the replay runs."""
    from foottrack_service.bus.control import ControlServer
    from foottrack_service.bus.errors import ControlError
    from foottrack_service.cli.keys import keys

    replay = await asyncio.shield(started)
    server = ControlServer(bus.context, "tcp://127.0.0.1:0", replay.handlers)
    answers = asyncio.ensure_future(server.run())
    try:
        await bus.control().request("replay/attach", {"endpoint": server.endpoint})
    except ControlError as error:
        typer.echo(f"The control socket will not know this replay: {error}", err=True)

    def on_key(key: str) -> None:
        if not replay.on_key(key):
            task.cancel()

    try:
        with keys(on_key) as listening, Status("", console=Console(stderr=True)) as shown:
            hint = "space pauses, arrows seek, + and - change the pace, q ends" if listening else "Ctrl-C ends it"
            while True:
                now = replay.status
                state = "paused" if now.paused else f"x {now.rate:g}"
                shown.update(f"{file.name}: {now.position:.1f} of {now.duration:.1f} s, {state} ({hint})")
                await asyncio.sleep(_REDRAW_S)
    finally:
        answers.cancel()
        await asyncio.wait({answers})
        server.close()
