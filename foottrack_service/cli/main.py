"""``foottrack``: the command line. One module per group of commands; what is heavy is imported by who needs it."""

from __future__ import annotations

import io
import sys
from typing import Annotated

import typer

from foottrack_protocol.errors import ProtocolError
from foottrack_service.bus.errors import BusError
from foottrack_service.cli import (
    bench,
    calibrate,
    camera,
    demo,
    doctor,
    evaluate,
    imu,
    log,
    markers,
    recordings,
    running,
    security,
    service,
    settings,
    sim,
    walk,
    walkinplace,
    watch,
)
from foottrack_service.config import ConfigError
from foottrack_service.evaluation.datasets import DatasetError
from foottrack_service.recording.errors import RecordingError

app = typer.Typer(
    name="foottrack",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Tracks a person's feet for virtual reality and streams them to any engine. Begin with: foottrack demo",
)
app.command()(demo.demo)
app.command()(service.run)
app.command()(service.node)
app.command("compile")(service.compile_kernels)
app.command()(sim.sim)
app.command()(recordings.record)
app.command()(recordings.replay)
app.command()(watch.top)
app.command()(watch.echo)
app.command()(evaluate.evaluate)
app.command()(walkinplace.trial)
app.command()(bench.bench)
app.command()(doctor.doctor)
app.command()(security.relay)
app.add_typer(security.app, name="keys")
app.add_typer(settings.app, name="config")
app.add_typer(calibrate.app, name="calibrate")
app.add_typer(imu.app, name="imu")
app.command()(camera.camera)
app.command()(markers.markers)
app.add_typer(walk.app, name="walk")
app.add_typer(log.app, name="log", help="Look into recordings: info, cat, export, import, diff, recover.")


@app.callback()
def common(
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Say more of what is going on.")] = False,
) -> None:
    """What all commands have."""
    running.set_up_logging(verbose)


def main() -> None:
    """Entry point: errors that a person can mend are one line and an exit code, not a traceback."""
    running.collect_seldom()
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Windows' code pages lack letters of units and names, and a file's name may be no text at all.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        app()
    except running.CommandFailed as error:
        running.fail(str(error), error.code)
    except ConfigError as error:
        running.fail(str(error), running.EXIT_USAGE)
    except (BusError, ProtocolError, RecordingError, DatasetError) as error:
        running.fail(str(error))
    except OSError as error:
        # One that names a file is about a path that a person gave.
        if error.filename is None:
            raise
        running.fail(f"{error.filename}: {error.strerror or error}")
