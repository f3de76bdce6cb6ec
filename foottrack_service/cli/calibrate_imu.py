"""``foottrack calibrate imu``: rest biases, and which sensor is on which foot."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Annotated, Any

import typer

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Imu, ImuCalibration, ImuValues, Side
from foottrack_service.bus.subscriber import Subscriber
from foottrack_service.calibration.store import Store, StoreError
from foottrack_service.cli.joining import joined
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
from foottrack_service.imu.calibration import ImuCalibrator

LOOK_S = 0.02
FIND_S = 2.0


def imu(
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    timeout: Annotated[float, typer.Option(min=1.0, help="For each step, s.")] = 30.0,
    tap: Annotated[bool, typer.Option("--tap/--no-tap", help="Ask for the tap that tells left from right.")] = True,
    as_json: JsonOption = False,
) -> None:
    """Find what the IMUs read at rest, and which of them is on which foot. The service has to run.

    Example: foottrack calibrate imu
    """
    settings = settings_for(config, user, connect)
    result = run_loop(calibrate(settings, timeout, tap, lambda text: typer.echo(text, err=True)))
    store = Store.at_home(settings.user, settings.feet.shoes)
    try:
        for values in result["imus"].values():
            store.keep(ImuCalibration(values=ImuValues.model_validate(values)))
    except StoreError as error:
        raise CommandFailed(f"what was found could not be kept: {error}") from None
    if as_json:
        print_json(result)
        return
    for side, values in result["imus"].items():
        gyro, acc = (", ".join(f"{value:+.4f}" for value in values[key]) for key in ("gyro_bias", "acc_bias"))
        typer.echo(f"{side}: gyro bias {gyro} rad/s; accelerometer bias along gravity {acc} m/s^2")
    if result["swapped"] is not None:
        typer.echo("left and right are as the settings say")


async def calibrate(settings: Settings, timeout_s: float, tap: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Both steps on a running bus; publishes what was found. Raises CommandFailed, NotReady."""
    async with joined(settings) as bus:
        subscriber = bus.subscriber([f"{settings.user}/imu/"])
        publisher = bus.publisher("calibrate-imu")
        await subscriber.ready()
        await publisher.ready()
        sides = await _sides(subscriber)
        calibrator = ImuCalibrator(sides)
        say(f"Found: {', '.join(sides)}. Stand still, feet on the floor ...")
        if not await _until(subscriber, calibrator, lambda: calibrator.all_rested, timeout_s):
            reasons = "; ".join(f"{side}: {problem}" for side, problem in calibrator.problems.items())
            raise CommandFailed(f"no rest in {timeout_s:g} s. {reasons}")
        if tap and len(sides) == 2:
            say("Now tap the LEFT foot's sensor twice with a finger ...")
            if not await _until(subscriber, calibrator, lambda: calibrator.swapped is not None, timeout_s):
                raise CommandFailed(f"no double tap in {timeout_s:g} s: tap harder, half a second apart, one foot only")
            if calibrator.swapped:
                raise CommandFailed("the sensors are swapped: exchange the ports of [imu.left] and [imu.right]")
        found: dict[Side, ImuValues] = {side: calibrator.values(side, settings.feet.of(side)) for side in sides}
        for values in found.values():
            publisher.publish(settings.user, "calibration", bus.clock(), ImuCalibration(values=values))
        return {
            "imus": {side: values.model_dump(mode="json") for side, values in found.items()},
            "swapped": calibrator.swapped,
        }


async def _sides(subscriber: Subscriber) -> tuple[Side, ...]:
    """The sides that send something."""
    heard: set[Side] = set()
    try:
        async with asyncio.timeout(FIND_S):
            while len(heard) < len(SIDES):
                heard |= {side for side, _, _ in _samples(subscriber)}
                await asyncio.sleep(LOOK_S)
    except TimeoutError:
        if not heard:
            raise CommandFailed("no IMU is heard: is one set up in [imu], and plugged in?") from None
    return tuple(side for side in SIDES if side in heard)


async def _until(subscriber: Subscriber, calibrator: ImuCalibrator, done: Callable[[], bool], timeout_s: float) -> bool:
    try:
        async with asyncio.timeout(timeout_s):
            while not done():
                for side, t, body in _samples(subscriber):
                    calibrator.add(side, t, body.acc, body.gyro)
                await asyncio.sleep(LOOK_S)
    except TimeoutError:
        return False
    return True


def _samples(subscriber: Subscriber) -> list[tuple[Side, float, Imu]]:
    samples = []
    for received in subscriber.drain():
        message = received.message
        if message.valid and isinstance(message.data, Imu):
            side: Side = "left" if message.stream == "imu/left" else "right"
            samples.append((side, message.t * 1e-9, message.data))
    return samples
