"""``foottrack walk``: key poses in, a walk without foot slip out."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from foottrack_service.cli import walk_files
from foottrack_service.cli.running import (
    EXIT_USAGE,
    CommandFailed,
    ConfigOption,
    ConnectOption,
    JsonOption,
    UserOption,
    fail,
    print_json,
    run_loop,
    settings_for,
)
from foottrack_service.cli.walk_source import cycle_of, knobs, motion_facts, project_of, walk_of

if TYPE_CHECKING:
    from foottrack_service.walkcycle.project import Project
    from foottrack_service.walkcycle.walk import Walk

app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False, help=__doc__)

F = TypeVar("F", bound=Callable[..., Any])

SourceArgument = Annotated[
    str,
    typer.Argument(metavar="WALK", help="A preset (normative, animator, sneak, double-bounce) or a project FILE.json."),
]
OutOption = Annotated[Path | None, typer.Option("--out", "-o", help="File to write; its ending chooses the format.")]
PathOption = Annotated[
    str,
    typer.Option(
        "--path",
        help="line:LENGTH[,DEGREES], circle:RADIUS[,DEGREES], s:LENGTH[,WIDTH], corner:LENGTH[,DEGREES], FILE.json",
    ),
]
StepsOption = Annotated[int | None, typer.Option("--steps", help="So many steps; as many as the path holds if absent.")]
SecondsOption = Annotated[float | None, typer.Option("--seconds", help="At most so long, s.")]
SpeedsOption = Annotated[
    str | None, typer.Option("--speeds", help="Changing speed: SHARE:FACTOR,... such as 0:1,0.5:1.6,1:0.8 of the way.")
]
FpsOption = Annotated[float, typer.Option("--fps", min=5.0, max=1000.0, help="Frames per second of the file.")]
HeightOption = Annotated[float | None, typer.Option("--height", help="Another body's height, m; scaled by leg length.")]
SpeedOption = Annotated[float | None, typer.Option("--speed", help="m/s.")]
FramesOption = Annotated[float | None, typer.Option("--frames", help="Frames per cycle at 24 fps.")]
StepLengthOption = Annotated[float | None, typer.Option("--step-length", help="m.")]
StepHeightOption = Annotated[float | None, typer.Option("--step-height", help="Highest lift of the ankle, m.")]
BounceOption = Annotated[float | None, typer.Option("--bounce", help="The pelvis from lowest to highest, m.")]
SwayOption = Annotated[float | None, typer.Option("--sway", help="The pelvis from side to side, m.")]
ToeOutOption = Annotated[float | None, typer.Option("--toe-out", help="Degrees.")]


def _mendable(command: F) -> F:
    """What a person can mend is one line and exit code 2, with nothing written."""

    @functools.wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> Any:
        from foottrack_service.bus.errors import BusError
        from foottrack_service.recording.errors import RecordingError
        from foottrack_service.walkcycle.errors import WalkError

        try:
            return command(*args, **kwargs)
        except CommandFailed as error:
            fail(str(error), error.code)
        except (WalkError, RecordingError) as error:
            fail(str(error), EXIT_USAGE)
        except BusError as error:
            fail(str(error))

    return guarded  # type: ignore[return-value]


@app.command()
@_mendable
def new(
    source: SourceArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="Project to write, .json.")],
    speed: SpeedOption = None,
    frames: FramesOption = None,
    step_length: StepLengthOption = None,
    step_height: StepHeightOption = None,
    bounce: BounceOption = None,
    sway: SwayOption = None,
    toe_out: ToeOutOption = None,
) -> None:
    """Write a project to pose on, from a preset or another project.

    Example: foottrack walk new animator --bounce 0.09 --toe-out 8 --out mine.json
    """
    walk_files.check_ending(out, (".json",))
    from foottrack_service.walkcycle.project import format_project

    project = project_of(source, knobs(speed, frames, step_length, step_height, bounce, sway, toe_out))
    walk_files.write_whole(out, format_project(project).encode())
    typer.echo(f"Wrote {out}: {len(project.keys)} poses.", err=True)


@app.command()
@_mendable
def show(
    source: SourceArgument,
    schema: Annotated[bool, typer.Option("--schema", help="The JSON schema of project files instead.")] = False,
    json: JsonOption = False,
) -> None:
    """Stride, speed, contacts and poses of a walk; or what a written .bvh or .glb holds.

    Examples: foottrack walk show sneak; foottrack walk show mine.json --json; foottrack walk show walk.bvh
    """
    from foottrack_service.walkcycle.cycle import build_cycle
    from foottrack_service.walkcycle.project import Project

    if schema:
        print_json(Project.model_json_schema())
        return
    if (held := motion_facts(Path(source))) is not None:
        if json:
            print_json(held)
        else:
            typer.echo(f"{source}: {held['joints']} joints, {held['frames']} frames, {held['seconds']:.2f} s")
        return
    project = project_of(source)
    cycle = build_cycle(project)
    facts = {
        "name": project.name,
        "stride_m": cycle.stride,
        "period_s": cycle.period,
        "speed_m_s": cycle.speed,
        "height_m": cycle.body.height,
        "contact": project.contact.model_dump(),
        "keys": [{"name": key.name, "phase": key.phase} for key in project.keys],
        "offsets": project.offsets,
    }
    if json:
        print_json(facts)
        return
    c = project.contact
    typer.echo(f"{project.name}: stride {cycle.stride:.3f} m in {cycle.period:.2f} s, {cycle.speed:.2f} m/s")
    typer.echo(
        f"flat at {100 * c.flat:.0f} %, heel off at {100 * c.heel_off:.0f} %, toe off at {100 * c.toe_off:.0f} %"
    )
    typer.echo("poses: " + ", ".join(f"{key.name} {100 * key.phase:.1f} %" for key in project.keys))


@app.command()
@_mendable
def cycle(
    source: SourceArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="Project to write, .json.")],
    bake: Annotated[int | None, typer.Option("--bake", help="One pose per frame instead, so many a cycle.")] = None,
) -> None:
    """Write both steps of a cycle out as poses: the second by mirroring, or baked frame by frame.

    Examples: foottrack walk cycle animator --out both.json; foottrack walk cycle mine.json --bake 24 --out baked.json
    """
    walk_files.check_ending(out, (".json",))
    from foottrack_service.walkcycle.operations import bake as baked
    from foottrack_service.walkcycle.project import format_project, full_cycle

    project = project_of(source)
    project = full_cycle(project) if bake is None else baked(project, bake)
    walk_files.write_whole(out, format_project(project).encode())
    typer.echo(f"Wrote {out}: {len(project.keys)} poses.", err=True)


@app.command()
@_mendable
def along(
    source: SourceArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write: .bvh, .glb, .mcap or .json (the project).")],
    path: PathOption = "line:5",
    steps: StepsOption = None,
    seconds: SecondsOption = None,
    speeds: SpeedsOption = None,
    height: HeightOption = None,
    fps: FpsOption = 60.0,
    speed: SpeedOption = None,
    frames: FramesOption = None,
    step_length: StepLengthOption = None,
    step_height: StepHeightOption = None,
    bounce: BounceOption = None,
    sway: SwayOption = None,
    toe_out: ToeOutOption = None,
    json: JsonOption = False,
    user: UserOption = None,
    config: ConfigOption = None,
) -> None:
    """Walk along a path and write the motion; planted feet do not slip.

    Examples: foottrack walk along normative --path circle:3 --out walk.bvh;
    foottrack walk along animator --path s:8 --steps 8 --out eight.glb; foottrack walk along mine.json --out walk.mcap
    """
    ending = walk_files.check_ending(out)
    project = project_of(source, knobs(speed, frames, step_length, step_height, bounce, sway, toe_out))
    made = walk_of(project, path, steps, seconds, speeds, height)
    if ending == ".mcap":
        walk_files.record_walk(made, settings_for(config, user), out)
    else:
        walk_files.write_whole(out, walk_files.walk_file(made, project, ending, fps))
    _report(out, made, json)


@app.command()
@_mendable
def play(
    source: SourceArgument,
    path: PathOption = "circle:1",
    steps: StepsOption = None,
    seconds: SecondsOption = None,
    speeds: SpeedsOption = None,
    height: HeightOption = None,
    rate: Annotated[float, typer.Option("--rate", min=10.0, max=500.0, help="Poses per second.")] = 100.0,
    loop: Annotated[bool, typer.Option("--loop", help="Again and again until Ctrl-C.")] = False,
    user: UserOption = None,
    config: ConfigOption = None,
    connect: ConnectOption = None,
) -> None:
    """Publish a walk on a running bus as a tracked person would cause it: pose/body, pose/ik, gait/state, gait/event.

    Example: foottrack walk play sneak --path circle:1 --loop
    """
    made = walk_of(project_of(source), path, steps, seconds, speeds, height)
    settings = settings_for(config, user, connect)
    typer.echo(f"{source}, {made.duration:.1f} s, on {settings.bus.ingress}. Ctrl-C ends it.", err=True)
    try:
        run_loop(walk_files.play_walk(made, settings, rate, loop=loop))
    except KeyboardInterrupt:
        typer.echo("Stopped.", err=True)


@app.command()
@_mendable
def export(
    source: SourceArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write, .bvh or .glb.")],
    height: HeightOption = None,
    fps: FpsOption = 60.0,
) -> None:
    """Write one cycle on the spot that loops: its last frame is its first.

    Example: foottrack walk export double-bounce --out loop.glb
    """
    ending = walk_files.check_ending(out, (".bvh", ".glb"))
    made = cycle_of(project_of(source), height)
    walk_files.write_whole(out, walk_files.cycle_file(made, ending, fps))
    typer.echo(f"Wrote {out}: one cycle of {made.period:.2f} s.", err=True)


@app.command()
@_mendable
def plot(
    source: SourceArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the pictures.")],
    path: PathOption = "s:6",
    steps: StepsOption = None,
    height: HeightOption = None,
) -> None:
    """Draw the five poses, the arcs, the footprints from above, and the joint angles with the normative band (PNG).

    Example: foottrack walk plot normative --path circle:1 --out pictures
    """
    from foottrack_service.walkcycle.plot import plot_all

    made = walk_of(project_of(source), path, steps, None, None, height)
    try:
        files = plot_all(made.cycle, made, out)
    except OSError as error:
        raise CommandFailed(f"--out {out}: {error.strerror or error}", EXIT_USAGE) from None
    typer.echo("Wrote " + ", ".join(str(file) for file in files), err=True)


@app.command()
@_mendable
def measure(
    source: Annotated[str, typer.Argument(metavar="[WALK]", help="A preset or a project; all presets if absent.")] = "",
    path: Annotated[str, typer.Option("--path", help="One path; the standard ones if absent.")] = "",
    json: JsonOption = False,
) -> None:
    """Slip, penetration, closure, round trip and joint angles, re-read from the written files.

    Examples: foottrack walk measure; foottrack walk measure animator --path circle:1 --json
    """
    from foottrack_service.walkcycle.presets import PRESETS
    from foottrack_service.walkcycle.report import measure_all, table

    projects = [project_of(source)] if source else [project_of(name) for name in PRESETS]
    figures = measure_all(projects, [path] if path else None)
    rate = _frames_per_second(project_of(source or "normative"))
    if json:
        print_json({"walks": figures, "frames_per_s": rate})
    else:
        typer.echo(table(figures))
        typer.echo(f"{rate:.0f} frames generated per second (a minute round a circle at 60 fps)")


def _frames_per_second(project: Project) -> float:
    from time import perf_counter

    import numpy as np

    made = walk_of(project, "circle:10,360", None, 60.0, None, None)
    times = np.arange(0.0, made.duration, 1.0 / 60.0)
    began = perf_counter()
    made.motion(times)
    return len(times) / (perf_counter() - began)


def _report(out: Path, walk: Walk, json: bool) -> None:
    strikes = len([c for c in walk.contacts if c.print.strike > walk.plan.start])
    facts = {"file": str(out), "seconds": walk.duration, "steps": strikes, "stride_m": walk.cycle.stride}
    if json:
        print_json(facts)
    else:
        typer.echo(f"Wrote {out}: {strikes - 1} steps and the one that closes, {walk.duration:.2f} s.", err=True)
