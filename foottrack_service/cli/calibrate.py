"""``foottrack calibrate``: one command for each thing that can be calibrated."""

from __future__ import annotations

import typer

from foottrack_service.cli import calibrate_headset, calibrate_imu, calibrate_mounting, calibrate_person, camera

app = typer.Typer(no_args_is_help=True, help="Measure what the settings cannot know.")
app.command("floor")(calibrate_person.floor)
app.command("heading")(calibrate_person.heading)
app.command("body")(calibrate_person.body)
app.command("mount")(calibrate_person.mount)
app.command("imu")(calibrate_imu.imu)
app.command("mounting")(calibrate_mounting.mounting)
app.command("headset")(calibrate_headset.headset)
app.command("camera")(camera.calibrate_camera)
app.command("floor-by-depth")(camera.calibrate_floor)
