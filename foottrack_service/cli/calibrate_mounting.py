"""``foottrack calibrate mounting``: how each IMU sits on its shoe, from standing still and one step."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import typer

from foottrack_protocol.messages import Imu, ImuCalibration, ImuValues, Side
from foottrack_service import rotations as rot
from foottrack_service.calibration.store import Store, StoreError
from foottrack_service.cli.calibrate_imu import FIND_S, LOOK_S
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
from foottrack_service.config import FootSettings, Settings
from foottrack_service.fusion.imu_mounting import Mounting, MountingError, find_mounting
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.imu.calibration import REST_S, RETRY_S, RestWatch

MOST_SAMPLES = 20_000
"""A person who waits so long before the step begins again; 50 s at 400 Hz."""


def mounting(
    config: ConfigOption = None,
    user: UserOption = None,
    connect: ConnectOption = None,
    timeout: Annotated[float, typer.Option(min=5.0, help="For all of it, s.")] = 60.0,
    as_json: JsonOption = False,
) -> None:
    """Find how the IMUs sit on the shoes: stand still for 3 s, then one step forward. The service has to run.

    Example: foottrack calibrate mounting
    """
    settings = settings_for(config, user, connect)
    found = run_loop(calibrate(settings, timeout, lambda text: typer.echo(text, err=True)))
    store = Store.at_home(settings.user, settings.feet.shoes)
    try:
        for values in found.values():
            store.keep(ImuCalibration(values=values))
    except StoreError as error:
        typer.echo(f"It counts until the service ends: {error}", err=True)
    if as_json:
        print_json({"imus": {side: values.model_dump(mode="json") for side, values in found.items()}})
        return
    for side, values in found.items():
        turn = math.degrees(float(rot.angle_between(np.array(values.q), np.array(settings.feet.of(side).imu.q))))
        typer.echo(f"{side}: sits {turn:.0f} degrees from where the settings have it; this counts from now on")


async def calibrate(settings: Settings, timeout_s: float, say: Callable[[str], None]) -> dict[Side, ImuValues]:
    """On a running bus; publishes what was found. Raises CommandFailed, NotReady."""
    async with joined(settings) as bus:
        subscriber = bus.subscriber([f"{settings.user}/imu/"])
        publisher = bus.publisher("calibrate-mounting")
        await subscriber.ready()
        await publisher.ready()
        finders: dict[Side, MountingFinder] = {}
        found: dict[Side, ImuValues] = {}
        said = ""
        say("Stand still with both feet on the floor ...")
        began = bus.clock()
        while not found or len(found) < len(finders):
            for received in subscriber.drain():
                message = received.message
                if message.valid and isinstance(message.data, Imu):
                    side: Side = "left" if message.stream == "imu/left" else "right"
                    finder = finders.setdefault(side, MountingFinder(settings.feet.of(side), side))
                    finder.add(_sample(message.t, message.data))
                    if finder.values is not None and side not in found:
                        found[side] = finder.values
                        publisher.publish(settings.user, "calibration", bus.clock(), ImuCalibration(values=found[side]))
            waited = (bus.clock() - began) * 1e-9
            if not finders and waited > FIND_S:
                raise CommandFailed("no IMU is heard: is one set up in [imu], and plugged in?")
            open_ = {side: finder.problem for side, finder in finders.items() if side not in found}
            if waited > timeout_s:
                raise CommandFailed("; ".join(f"{side}: {problem}" for side, problem in open_.items()))
            asked = _advice(finders, open_)
            if asked != said:
                say(asked)
                said = asked
            await asyncio.sleep(LOOK_S)
        return found


class MountingFinder:
    """One foot's samples until they show how its sensor sits. No bus and no clock."""

    def __init__(self, foot: FootSettings, side: Side) -> None:
        self._foot, self._side = foot, side
        self.values: ImuValues | None = None
        """The result."""
        self._tried = 0
        self._begin("stand still for 3 s")

    def add(self, sample: ImuSample) -> None:
        """One sample; a stamp that goes back begins anew."""
        if self.values is not None:
            return
        if self._samples and sample.t <= self._samples[-1].t:
            if (self._samples[-1].t - sample.t) * 1e-9 > RETRY_S:
                self._begin("stand still for 3 s")
            return
        self._samples.append(sample)
        if len(self._samples) > MOST_SAMPLES:
            self._begin("stand still for 3 s, then take one step")
            return
        if not self.rested:
            self._rest.add(sample.t * 1e-9, _triple(sample.acc), None if sample.gyro is None else _triple(sample.gyro))
            self._forget()
        elif abs(sample.t - self._tried) * 1e-9 > RETRY_S:
            self._tried = sample.t
            self._try()

    @property
    def rested(self) -> bool:
        """Whether it waits for the step."""
        return self._rest.found is not None

    def _begin(self, problem: str) -> None:
        self.problem = problem
        """What is wrong, or missing."""
        self._rest = RestWatch()
        self._samples: list[ImuSample] = []

    def _try(self) -> None:
        try:
            found = find_mounting(self._samples)
        except MountingError as error:
            if not error.unfinished:
                self._begin(str(error))
                return
            self.problem = str(error)
            return
        self.values = self._as_values(found)

    def _forget(self) -> None:
        first = next(i for i, s in enumerate(self._samples) if (self._samples[-1].t - s.t) * 1e-9 <= REST_S)
        del self._samples[:first]

    def _as_values(self, found: Mounting) -> ImuValues:
        assert self._rest.found is not None
        x, y, z, w = found.q.tolist()
        acc_bias = _triple(self._rest.found.acc_bias_along_gravity)
        return ImuValues(
            side=self._side, acc_bias=acc_bias, gyro_bias=_triple(found.gyro_bias), p=self._foot.imu.p, q=(x, y, z, w)
        )


def _advice(finders: dict[Side, MountingFinder], open_: dict[Side, str]) -> str:
    if not open_ or not all(finders[side].rested for side in open_):
        again = [problem for problem in open_.values() if not problem.startswith("stand still for 3 s")]
        return f"Once more: {again[0]}. First stand still ..." if again else "Stand still ..."
    return "Now take ONE step straight ahead, bring the other foot beside it, and stand still ..."


def _sample(t: int, body: Imu) -> ImuSample:
    gyro = None if body.gyro is None else np.array(body.gyro)
    return ImuSample(t, np.array(body.acc), gyro, None if body.q is None else np.array(body.q))


def _triple(v: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in v)
    return x, y, z
