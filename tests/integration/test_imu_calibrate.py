"""``foottrack calibrate imu`` beside a bus on which two simulated IMUs are published."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from bus_traffic import answering

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import Imu, ImuCalibration
from foottrack_service.bus import Broker, Bus
from foottrack_service.bus.clock import now
from foottrack_service.cli.calibrate_imu import calibrate
from foottrack_service.cli.running import CommandFailed
from foottrack_service.config import Settings
from foottrack_service.imu.calibration import REST_S, ImuCalibrator, RestWatch

GYRO_BIAS = {"left": (0.01, -0.02, 0.005), "right": (-0.03, 0.0, 0.01)}
SAMPLES_PER_TURN = 4
"""Stamps run faster than the clock, so that three seconds of rest take less than one."""


class Wearer:
    """Publishes both IMUs; ``tapping`` is the side that is tapped twice, again and again."""

    def __init__(self, bus: Bus, sides: tuple[str, ...] = ("left", "right")) -> None:
        self.publishers = {side: bus.publisher(f"imu-{side}") for side in sides}
        self.tapping: str | None = None
        self.walking = False
        self.rng = np.random.default_rng(3)

    async def run(self) -> None:
        for publisher in self.publishers.values():
            await publisher.ready()
        k = 0
        while True:
            for _ in range(SAMPLES_PER_TURN):
                for side, publisher in self.publishers.items():
                    publisher.publish("user", f"imu/{side}", k * 10_000_000, self.body(side, k))
                k += 1
            await asyncio.sleep(0.002)

    def body(self, side: str, k: int) -> Imu:
        acc = np.array([0.0, STANDARD_GRAVITY + 0.05, 0.0]) + self.rng.normal(scale=0.02, size=3)
        if self.walking:
            acc[0] += 5.0 * np.sin(0.1 * k)
        if side == self.tapping and k % 200 in (50, 90):
            acc[1] += 25.0
        gyro = np.asarray(GYRO_BIAS[side]) + self.rng.normal(scale=0.002, size=3)
        return Imu(acc=tuple(map(float, acc)), gyro=tuple(map(float, gyro)), t_arr=now())  # type: ignore[arg-type]


def tapped(wearer: Wearer, side: str | None) -> Callable[[str], None]:
    """What the person does when asked to tap."""

    def say(text: str) -> None:
        if "tap" in text:
            wearer.tapping = side

    return say


async def scenario(
    broker: Broker, bus: Bus, wearer: Wearer, act: Callable[[str], None], timeout_s: float = 20.0
) -> Any:
    playing = asyncio.create_task(wearer.run())
    try:
        async with answering(broker) as ends:
            return await calibrate(Settings(bus=ends), timeout_s, True, act)
    finally:
        playing.cancel()
        await asyncio.gather(playing, return_exceptions=True)


def test_biases_are_found_and_published(broker: Broker, bus: Bus, run: Any) -> None:
    wearer = Wearer(bus)

    async def with_listener() -> tuple[Any, list[Any]]:
        listener = bus.subscriber(["user/calibration"])
        await listener.ready()
        result = await scenario(broker, bus, wearer, tapped(wearer, "left"))
        published: list[Any] = []
        while len(published) < 2:
            published += [received.message.data for received in listener.drain()]
            await asyncio.sleep(0.005)
        return result, published

    result, published = run(with_listener())
    assert result["swapped"] is False
    assert all(isinstance(body, ImuCalibration) for body in published)
    for body in published:
        assert body.values.gyro_bias == pytest.approx(GYRO_BIAS[body.values.side], abs=1e-3)
        assert body.values.acc_bias == pytest.approx((0.0, 0.05, 0.0), abs=5e-3)
        assert body.values.q == (0.0, 0.0, 0.0, 1.0)
        assert result["imus"][body.values.side]["gyro_bias"] == pytest.approx(body.values.gyro_bias)


def test_swapped_sensors_are_noticed(broker: Broker, bus: Bus, run: Any) -> None:
    wearer = Wearer(bus)
    with pytest.raises(CommandFailed, match="exchange the ports"):
        run(scenario(broker, bus, wearer, tapped(wearer, "right")))


def test_one_sensor_needs_no_tap(broker: Broker, bus: Bus, run: Any) -> None:
    result = run(scenario(broker, bus, Wearer(bus, ("right",)), lambda text: None))
    assert list(result["imus"]) == ["right"]
    assert result["swapped"] is None


@pytest.mark.parametrize(
    ("walking", "text"), [(True, "no rest in 1 s.*left: the acceleration varies"), (False, "no double tap in 1 s")]
)
def test_what_a_person_does_wrong_is_said(walking: bool, text: str, broker: Broker, bus: Bus, run: Any) -> None:
    wearer = Wearer(bus)
    wearer.walking = walking
    with pytest.raises(CommandFailed, match=text):
        run(scenario(broker, bus, wearer, lambda text: None, timeout_s=1.0))


def test_without_imus_it_says_so(broker: Broker, bus: Bus, run: Any) -> None:
    with pytest.raises(CommandFailed, match="no IMU is heard"):
        run(scenario(broker, bus, Wearer(bus, ()), lambda text: None, 1.0))


def test_rest_is_found_after_a_movement_and_survives_stamps_that_go_back() -> None:
    watch = RestWatch()
    assert watch.problem == "nothing was received"
    t = 0.0
    for k in range(200):
        watch.add(t, (5.0 * (k % 2), STANDARD_GRAVITY, 0.0), (0.0, 0.0, 0.0))
        t += 0.01
    assert watch.found is None
    assert "longer" in watch.problem
    t = 0.0
    while watch.found is None and t < 20.0:
        watch.add(t, (0.0, STANDARD_GRAVITY, 0.0), (0.01, 0.0, 0.0))
        t += 0.01
    assert watch.found is not None
    assert REST_S <= t < REST_S + 1.0
    with pytest.raises(KeyError):
        ImuCalibrator(("left",)).values("left", Settings().feet.left)
