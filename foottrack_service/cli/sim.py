"""``foottrack sim``: a simulated person as fake publishers on a running bus, or as a recording."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress

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
from foottrack_service.config import Settings, to_toml


def sim(
    task: Annotated[
        str, typer.Option("--task", help="What the person does; an unknown one lists them.")
    ] = "walk-in-place",
    seed: Annotated[int, typer.Option("--seed", min=0, help="Another seed is another person with other noise.")] = 1,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=1.0, help="How long; the task's own if absent.")
    ] = None,
    imu_hz: Annotated[float, typer.Option("--imu-hz", min=20.0, max=1000.0, help="Rate of the IMUs.")] = 100.0,
    imu: Annotated[
        str, typer.Option("--imu", help="fused (its own attitude), raw (accelerometer and gyro) or bno08x (all).")
    ] = "fused",
    feet: Annotated[str, typer.Option("--feet", help="mild or hard (impacts, clipping, soft soles).")] = "mild",
    out: Annotated[
        Path | None, typer.Option("--out", help="Write a recording (MCAP) instead, faster than real time.")
    ] = None,
    user: UserOption = None,
    config: ConfigOption = None,
    connect: ConnectOption = None,
) -> None:
    """Publish a simulated person's IMUs, camera, headset and truth on a running bus, in real time.

    With --task calibration it does what the calibrations ask, and says when.
    Examples: foottrack sim --task line; foottrack sim --task walk --seed 7 --out walk.mcap
    """
    settings = settings_for(config, user, connect)
    scenario = scenario_for(task, seed, settings, seconds=seconds, imu_hz=imu_hz, imu=imu, feet=feet)
    if out is not None:
        write_recording(scenario, settings, out)
        return
    typer.echo(f"{task}, {scenario.seconds:g} s, on {settings.bus.ingress}. Ctrl-C ends it.", err=True)
    try:
        run_loop(_publish(settings, scenario, said(task, scenario.seconds)))
    except KeyboardInterrupt:
        typer.echo("Stopped.", err=True)


def scenario_for(task: str, seed: int, settings: Settings, **options: Any) -> Any:
    """The simulated scenario. Raises CommandFailed for an unknown task or option, listing the known ones."""
    from foottrack_service.simulation.scenario import simulate
    from foottrack_service.simulation.tasks import TASKS

    if task not in TASKS:
        known = "\n".join(f"  {each.name:15} {each.description}" for each in TASKS.values())
        raise CommandFailed(f"no task is called {task!r}; there are:\n{known}", EXIT_USAGE)
    choices: dict[str, tuple[str, ...]] = {"imu": ("fused", "raw", "bno08x"), "feet": ("mild", "hard")}
    for option, known_values in choices.items():
        if options.get(option, known_values[0]) not in known_values:
            raise CommandFailed(f"--{option} is {' or '.join(known_values)}, not {options[option]!r}", EXIT_USAGE)
    try:
        return simulate(task, seed, settings=settings, **options)
    except ValueError as error:
        raise CommandFailed(str(error), EXIT_USAGE) from None


def said(task: str, seconds: float) -> Callable[[float], None]:
    """Prints what the person does when its time, s, has come."""
    from foottrack_service.simulation.tasks import TASKS

    announced = TASKS[task].announced
    waiting = deque(() if announced is None else announced(seconds))

    def say(over: float) -> None:
        while waiting and waiting[0].at <= over:
            at, text = waiting.popleft()
            typer.echo(f"{int(at) // 60}:{int(at) % 60:02} {text}", err=True)

    return say


def write_recording(scenario: Any, settings: Settings, out: Path) -> None:
    """Write a scenario's messages as a recording. Raises RecordingError."""
    from foottrack_protocol import encode
    from foottrack_service.recording.file import RecordingFile

    messages = iter(scenario.messages())
    first = next(messages, None)
    if first is None:
        raise CommandFailed("the scenario has no messages")
    began = first[0]
    with (
        Progress(console=Console(stderr=True), transient=True) as progress,
        RecordingFile(out, to_toml(settings), began) as file,
    ):
        bar = progress.add_task(f"writing {out.name}", total=scenario.seconds)
        for count, (arrival, message) in enumerate(itertools.chain([first], messages)):
            topic, payload = encode(message)
            file.add(topic, payload, arrival, message.t_pub, message.seq)
            if count % 500 == 0:
                progress.update(bar, completed=(arrival - began) * 1e-9)
    typer.echo(f"Wrote {out}: {file.messages} messages, {scenario.seconds:g} s.", err=True)


async def _publish(settings: Settings, scenario: Any, progress: Callable[[float], None]) -> None:
    from foottrack_service.simulation import node

    async with joined(settings) as bus:
        await node.run(bus, settings, scenario, progress=progress)
