"""``foottrack trial``: [Z]'s experiment. A countdown, 50 m walked in place, time and speed."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated, Any

import typer

from foottrack_protocol.messages import GaitState
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.subscriber import Received
from foottrack_service.cli.running import (
    CommandFailed,
    ConfigOption,
    ConnectOption,
    JsonOption,
    UserOption,
    print_json,
    run_loop,
    settings_for,
)
from foottrack_service.config import Settings
from foottrack_service.gait.trial import COUNTDOWN_S, DISTANCE_M, Trial
from foottrack_service.recording.reader import open_recording

_SILENCE_S = 10.0
_EVERY_M = 5.0


def trial(
    file: Annotated[
        Path | None, typer.Argument(help="A recording: walked again offline. A live user of the service if absent.")
    ] = None,
    distance: Annotated[float, typer.Option("--distance", min=1.0, help="m.")] = DISTANCE_M,
    countdown: Annotated[float, typer.Option("--countdown", min=0.0, help="s.")] = COUNTDOWN_S,
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    as_json: JsonOption = False,
) -> None:
    """Walk a way in place: after a countdown, 50 m by the avatar's speed; then time, mean and top speed.

    Examples: foottrack trial; foottrack trial session.mcap --distance 20
    """
    run = Trial(distance, countdown)
    if file is not None:
        from foottrack_service.cli.offline import results_of, settings_of

        recording = open_recording(file)
        settings = settings_of(recording, config)
        for message in results_of(recording, settings, quiet=as_json):
            if message.stream == "gait/state":
                _feed(run, message.t, message.data)
            if run.finished:
                break
    else:
        run_loop(_live(run, settings_for(config, user, connect), as_json))
    _report(run, as_json)


async def _live(run: Trial, settings: Settings, quiet: bool) -> None:
    done = asyncio.Event()
    spoken = [-1, 0]

    def on_batch(batch: list[Received]) -> None:
        heard.set()
        for received in batch:
            left = run.countdown(received.message.t)
            if not quiet:
                _speak(left, run.distance, spoken)
            _feed(run, received.message.t, received.message.data)
        if run.finished:
            done.set()

    heard = asyncio.Event()
    with Bus.connect(settings.bus) as bus:
        subscriber = bus.subscriber([f"{settings.user}/gait/state"])
        await subscriber.ready()
        reading = asyncio.create_task(subscriber.deliver(on_batch))
        try:
            await _finish(done, heard, settings.user)
        finally:
            reading.cancel()


async def _finish(done: asyncio.Event, heard: asyncio.Event, user: str) -> None:
    while not done.is_set():
        heard.clear()
        waiting = [asyncio.create_task(event.wait()) for event in (done, heard)]
        try:
            ended, _ = await asyncio.wait(waiting, timeout=_SILENCE_S, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waiting:
                task.cancel()
        if not ended:
            raise CommandFailed(f"no {user}/gait/state for {_SILENCE_S:g} s: does the service run, and has it feet?")


def _speak(left: float, distance: float, spoken: list[int]) -> None:
    """Whoever walks wears a headset: the terminal's bell marks "go"."""
    whole = int(left + 0.999)
    if whole != spoken[0]:
        spoken[0] = whole
        typer.echo(f"{whole} ..." if whole else "Go!\a", err=True)
    if distance >= spoken[1] + _EVERY_M:
        spoken[1] = int(distance)
        typer.echo(f"{spoken[1]} m", err=True)


def _feed(run: Trial, t: int, state: GaitState) -> None:
    run.update(t, state.speed, state.steps)


def _report(run: Trial, as_json: bool) -> None:
    result = run.result
    figures: dict[str, Any] = {
        "finished": result.finished,
        "seconds": round(result.seconds, 3),
        "distance_m": round(result.distance, 3),
        "mean_speed": round(result.mean_speed, 3),
        "top_speed": round(result.top_speed, 3),
        "steps": result.steps,
    }
    if as_json:
        print_json(figures)
    else:
        how = "The way is done" if result.finished else "The recording ended before the way did"
        typer.echo(
            f"{how}: {result.distance:.1f} m in {result.seconds:.1f} s, {result.steps} steps, "
            f"{result.mean_speed:.2f} m/s in the mean, {result.top_speed:.2f} at most."
        )
