"""``foottrack calibrate``: one module for each thing that can be calibrated."""

from __future__ import annotations

import typer

from foottrack_service.cli import calibrate_imu

app = typer.Typer(no_args_is_help=True, help="Measure what the settings cannot know.")
app.command("imu")(calibrate_imu.imu)
