"""``foottrack calibrate floor | heading | body | mount``: asks the service, and says what to do meanwhile.

The person has a headset on: what matters is said in few words and large, and a bell rings at the start, when there is
something new to do, twice at a good end and three times at a bad one.
"""

from __future__ import annotations

import asyncio
import math
import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer

from foottrack_service.bus.errors import ControlError
from foottrack_service.calibration.body import BodyFlow
from foottrack_service.calibration.flow import Flow, Refused
from foottrack_service.calibration.heading import HeadingFlow
from foottrack_service.cli.joining import joined
from foottrack_service.cli.running import (
    ConfigOption,
    ConnectOption,
    JsonOption,
    UserOption,
    print_json,
    run_loop,
    settings_for,
)
from foottrack_service.config import Settings

ANSWER_S = 75.0
"""How long to wait for the service, which itself gives up before."""
_LOOK_S = 0.02
_NEW_STAGE = 0.25
"""Progress by so much at once is something new to do."""
_BELL_S = 0.3
"""Bells closer together are heard as one."""
_RULE = "=" * 72

CountdownOption = Annotated[
    int, typer.Option("--countdown", min=0, max=60, help="Seconds to get into place before it begins.")
]
Say = Callable[[str], None]
Ring = Callable[[], None]


def floor(
    countdown: CountdownOption = 3,
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    as_json: JsonOption = False,
) -> None:
    """Find the floor: stand still on both feet and look down at them. The service has to run, with its camera.

    Example: foottrack calibrate floor
    """
    from foottrack_service.calibration.floor import FloorFlow

    settings = settings_for(config, user, connect)
    values = _calibrated(settings, "floor", {}, FloorFlow(settings), countdown, as_json)
    if values is not None:
        typer.echo(f"the floor is at {1000.0 * values['height']:+.0f} mm in the stage")


def heading(
    countdown: CountdownOption = 3,
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    as_json: JsonOption = False,
) -> None:
    """Find forward, and how the IMUs lie: look straight ahead, then take one step. The service has to run.

    Example: foottrack calibrate heading
    """
    settings = settings_for(config, user, connect)
    values = _calibrated(settings, "heading", {}, HeadingFlow(settings), countdown, as_json)
    if values is not None:
        yaws = {side: yaw for side, yaw in values["imu_yaw"].items() if yaw is not None}
        imus = ", ".join(f"{side} IMU {math.degrees(yaw):+.0f}" for side, yaw in yaws.items())
        typer.echo(f"forward is {math.degrees(values['yaw']):+.0f} deg of the stage's; {imus or 'no IMU with a yaw'}")


def body(
    height: Annotated[
        float | None, typer.Option("--height", help="Standing, without shoes and headset, m; measured if absent.")
    ] = None,
    countdown: CountdownOption = 3,
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    as_json: JsonOption = False,
) -> None:
    """Take the person's measures: stand upright for 3 s, look straight ahead, then nod. The service has to run.

    Example: foottrack calibrate body --height 1.78
    """
    settings = settings_for(config, user, connect)
    args = {} if height is None else {"height": height}
    values = _calibrated(settings, "body", args, BodyFlow(settings, height), countdown, as_json)
    if values is not None:
        typer.echo(", ".join(f"{name.replace('_', ' ')} {value:.2f} m" for name, value in values.items() if value))
        if values["neck_down"] is None:
            typer.echo("no nod was seen: the neck is where most people have it")


def mount(
    countdown: CountdownOption = 3,
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    as_json: JsonOption = False,
) -> None:
    """Find how the camera sits on the headset: stand, and look around at the feet. The service has to run.

    Example: foottrack calibrate mount
    """
    from foottrack_service.calibration.mount import MountFlow

    settings = settings_for(config, user, connect)
    values = _calibrated(settings, "mount", {}, MountFlow(settings), countdown, as_json)
    if values is not None:
        off_mm = 1000.0 * math.hypot(*values["p"])
        turned = math.degrees(2.0 * math.acos(min(1.0, abs(values["q"][3]))))
        typer.echo(
            f"the camera sits {off_mm:.1f} mm and {turned:.2f} deg off its settings, known to "
            f"{1000.0 * values['sigma_p']:.1f} mm and {math.degrees(values['sigma_q']):.2f} deg"
        )


async def ask(
    settings: Settings, kind: str, args: dict[str, Any], flow: Flow, countdown: int, say: Say, ring: Ring
) -> Any:
    """The service's answer; meanwhile ``flow`` watches the same streams for what to say. Raises BusError."""
    async with joined(settings) as bus:
        subscriber = bus.subscriber([f"{settings.user}/{stream}" for stream in flow.streams])
        await subscriber.ready()
        say(flow.progress.text)
        for left in range(countdown, 0, -1):
            say(str(left))
            await asyncio.sleep(1.0)
        ring()
        subscriber.drain()
        request = asyncio.ensure_future(
            bus.control().request(f"calibrate/{kind}", {"user": settings.user, **args}, ANSWER_S)
        )
        try:
            flow.begin(bus.clock())
            told = flow.progress
            while not request.done():
                # What this flow finds, or refuses, is the service's to say.
                if flow.found is None:
                    try:
                        for received in subscriber.drain():
                            flow.take(received.message, received.arrival)
                        flow.tick(bus.clock())
                    except Refused:
                        subscriber.close()
                        break
                if flow.progress.text != told.text and flow.found is None:
                    say(flow.progress.text)
                    if flow.progress.share >= told.share + _NEW_STAGE:
                        ring()
                    told = flow.progress
                await asyncio.sleep(_LOOK_S)
            result = await request
        except ControlError:
            await _bells(ring, 3)
            raise
        finally:
            request.cancel()
        say("Done. Thank you.")
        await _bells(ring, 2)
        return result


async def _bells(ring: Ring, times: int) -> None:
    for _ in range(times):
        ring()
        await asyncio.sleep(_BELL_S)


def _calibrated(
    settings: Settings, kind: str, args: dict[str, Any], flow: Flow, countdown: int, as_json: bool
) -> dict[str, Any] | None:
    result = run_loop(ask(settings, kind, args, flow, countdown, _say, _ring))
    if as_json:
        print_json(result)
        return None
    values: dict[str, Any] = result["values"]
    return values


def _say(text: str) -> None:
    typer.echo(f"\n{_RULE}\n\n    {text.upper()}\n\n{_RULE}", err=True)


def _ring() -> None:
    if sys.stderr.isatty():
        typer.echo("\a", nl=False, err=True)
