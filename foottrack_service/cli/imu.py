"""``foottrack imu``: what can be asked of the IMUs themselves."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from foottrack_service.cli.running import EXIT_USAGE, CommandFailed, JsonOption, print_json, run_loop

app = typer.Typer(no_args_is_help=True, help="Serial ports, noise, and a BNO08x's own calibration.")


class ChipAction(StrEnum):
    """What a BNO08x can do with its own calibration."""

    SAVE = "save"
    CLEAR = "clear"


@app.command()
def ports(
    listen: Annotated[bool, typer.Option("--listen", help="Open each and say what IMU talks there.")] = False,
    as_json: JsonOption = False,
) -> None:
    """List the serial ports, as the setting `port` takes them.

    Example: foottrack imu ports --listen
    """
    from foottrack_service.imu.ports import available

    found = available()
    heard = {port.device: run_loop(_listened(port.device)) for port in found} if listen else {}
    if as_json:
        print_json({"ports": [{**port._asdict(), **heard.get(port.device, {})} for port in found]})
        return
    for port in found:
        says = heard.get(port.device, {})
        told = says.get("error") or says.get("format") or ("no IMU" if says else "")
        typer.echo(f"{port}  {port.description}  {told}".rstrip())
    if not found:
        typer.echo("no serial port: is the sensor plugged in, and its cable one for data?")


@app.command()
def allan(
    file: Annotated[Path, typer.Argument(help="A recording of IMUs that lay still, best for an hour or more.")],
    out: Annotated[Path | None, typer.Option("--out", "-o", help="The picture; FILE.allan.png if absent.")] = None,
    chip: Annotated[str | None, typer.Option(help="Draw this chip's data sheet beside, such as bmi270.")] = None,
    gyro_density: Annotated[
        float | None, typer.Option(min=0.0, help="Or its noise density of the gyro, mdeg/s/sqrt(Hz),")
    ] = None,
    acc_density: Annotated[float | None, typer.Option(min=0.0, help="and of the accelerometer, ug/sqrt(Hz).")] = None,
    as_json: JsonOption = False,
) -> None:
    """Draw the Allan deviation and find the five noises in it.

    Example: foottrack imu allan still.mcap --chip bmi270
    """
    from foottrack_service.cli import imu_allan
    from foottrack_service.imu.datasheets import CHIPS, noise_density

    if chip is not None and chip not in CHIPS:
        raise CommandFailed(f"no data sheet of {chip!r} is known; there are: {', '.join(CHIPS)}", EXIT_USAGE)
    if (gyro_density is None) != (acc_density is None):
        raise CommandFailed("--gyro-density and --acc-density go together", EXIT_USAGE)
    sheet = None if chip is None else CHIPS[chip]
    if gyro_density is not None and acc_density is not None:
        sheet = noise_density(gyro_density, acc_density)
    curves, refused = imu_allan.analyse(file)
    for topic, reason in refused.items():
        typer.echo(f"{topic}: {reason}", err=True)
    if not curves:
        raise CommandFailed(f"{file}: no IMU that lay still")
    picture = out or file.with_suffix(".allan.png")
    try:
        imu_allan.draw(curves, sheet, picture)
    except OSError as error:
        raise CommandFailed(f"{picture}: {error.strerror or error}") from None
    if as_json:
        print_json({**imu_allan.as_values(curves, sheet), "picture": str(picture)})
        return
    for line in imu_allan.as_lines(curves, sheet):
        typer.echo(line)
    typer.echo(f"drawn: {picture}")


@app.command()
def chip(
    action: Annotated[ChipAction, typer.Argument(help="save what it learned so far, or clear it and restart.")],
    port: Annotated[str, typer.Option(help="Name, VID:PID[:SERIAL] or auto.")] = "auto",
    baud: Annotated[int | None, typer.Option(min=1, help="If it is not the format's own.")] = None,
) -> None:
    """Save or clear a BNO08x's own calibration. The service must not be using the port.

    Example: foottrack imu chip save --port /dev/ttyUSB0
    """
    from foottrack_service.imu import ports as serial_ports
    from foottrack_service.imu.chip import NoAnswer, command_chip
    from foottrack_service.imu.formats.sh2 import Command

    command = Command.SAVE_CALIBRATION if action == ChipAction.SAVE else Command.CLEAR_CALIBRATION_AND_RESET
    try:
        run_loop(command_chip(lambda: serial_ports.find(port, serial_ports.available()), command, baud))
    except NoAnswer as error:
        raise CommandFailed(str(error)) from None
    typer.echo("saved" if action == ChipAction.SAVE else "cleared, and restarted")


async def _listened(device: str) -> dict[str, Any]:
    from foottrack_service.imu.probe import probe

    try:
        return (await probe(device))._asdict()
    except OSError as error:
        return {"error": str(error)}
