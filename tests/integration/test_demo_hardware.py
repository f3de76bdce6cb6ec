"""The demo's hardware through the ordinary nodes: what comes onto the bus is what the simulation measured."""

from __future__ import annotations

import asyncio
import sys
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from foottrack_protocol import Message
from foottrack_service import rotations
from foottrack_service.app import NODES
from foottrack_service.bus import Bus
from foottrack_service.config import Settings
from foottrack_service.demo import hardware as demo_hardware
from foottrack_service.demo.hardware import Hardware
from foottrack_service.demo.pictures import RATES_HZ, PictureRate, affordable, rate_for
from foottrack_service.simulation.scenario import Scenario, simulate

Run = Callable[[Any], Any]
SECONDS = 2.0
needs_pty = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")


def person(imu_hz: float = 100.0) -> Scenario:
    return simulate("walk", 3, settings=Settings(), seconds=SECONDS, imu_hz=imu_hz, camera=False)


async def played(bus: Bus, scenario: Scenario, hardware: Hardware) -> tuple[int, dict[str, list[Message]]]:
    """Start of the scenario, and all that came onto the bus, by stream."""
    subscriber = bus.subscriber(["user/"])
    await subscriber.ready()
    start = bus.clock() + 300_000_000
    settings = hardware.found_by(start)
    nodes = [asyncio.ensure_future(n.run(bus, settings)) for n in (NODES["imu"], NODES["headset"])]
    for name in hardware.nodes:
        await bus.health.wait_running(name)
    expected = Counter(message.stream for _, message in scenario.messages())
    play = asyncio.ensure_future(hardware.play(bus, start))
    found: dict[str, list[Message]] = defaultdict(list)
    async for received in subscriber:
        # A machine that stalls makes the headset say that it is lost: that is nobody's measurement.
        if getattr(received.message.data, "tracked", True):
            found[received.message.stream].append(received.message)
        if all(len(found[stream]) >= count for stream, count in expected.items()):
            break
    await play
    for node in nodes:
        node.cancel()
    await asyncio.gather(*nodes, return_exceptions=True)
    return start, found


SAME_CLOCK_NS = 10_000_000_000
"""Stamps of another clock are further off; a stalled machine's are not."""


def check(start: int, scenario: Scenario, found: dict[str, list[Message]], resolution: float) -> None:
    sent: dict[str, list[Message]] = defaultdict(list)
    for _, message in scenario.at(start).messages():
        sent[message.stream].append(message)
    assert set(found) == set(sent)
    for stream, messages in sent.items():
        assert len(found[stream]) == len(messages)
        for got, meant in zip(found[stream], messages, strict=True):
            assert abs(got.t - meant.t) < SAME_CLOCK_NS
            if stream.startswith("imu/"):
                np.testing.assert_allclose(got.data.acc, meant.data.acc, atol=resolution)
            else:
                np.testing.assert_allclose(got.data.p, meant.data.p, atol=1e-5)
                assert rotations.angle_between(got.data.q, meant.data.q) < 1e-3


@needs_pty
@pytest.mark.parametrize(("imu_hz", "kind"), [(100.0, "rvc"), (200.0, "ascii")])
def test_everything_measured_arrives_through_ports_and_sockets(run: Run, bus: Bus, imu_hz: float, kind: str) -> None:
    scenario = person(imu_hz)
    with Hardware(scenario, Settings(), imu_hz, "none") as hardware:
        assert hardware.notes == []
        settings = hardware.found_by(0)
        assert settings.imu.left.format == settings.imu.right.format == kind
        assert not NODES["camera"].wanted(settings)
        start, found = run(played(bus, scenario, hardware))
    assert {message.src for message in found["imu/left"]} == {"imu-left"}
    check(start, scenario, found, 0.01)


def test_without_ptys_samples_go_onto_the_bus_and_it_is_said(
    run: Run, bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_pty(name: str) -> Any:
        raise OSError("Windows has no ptys")

    monkeypatch.setattr(demo_hardware, "PluggedImu", no_pty)
    scenario = person()
    with Hardware(scenario, Settings(), 100.0, "none") as hardware:
        assert "straight onto the bus" in hardware.notes[0] and "no ptys" in hardware.notes[0]
        assert not NODES["imu"].wanted(hardware.found_by(0))
        start, found = run(played(bus, scenario, hardware))
    check(start, scenario, found, 1e-9)


def test_pictures_are_of_the_same_person_at_the_same_time_and_as_many_as_the_machine_draws(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    measured: list[Settings] = []

    def slow(settings: Settings) -> PictureRate:
        measured.append(settings)
        return PictureRate(15.0, 0.050)

    monkeypatch.setattr(demo_hardware, "affordable", slow)
    scenario = person()
    with Hardware(scenario, Settings(), 100.0, "rendered") as hardware:
        source = hardware.found_by(123).camera.source
    assert (source.kind, source.rendered.fps) == ("rendered", 15.0)
    assert (source.rendered.task, source.rendered.seed, source.rendered.seconds) == ("walk", 3, SECONDS)
    assert source.rendered.start == 123
    assert measured[0].camera.source.rendered.fps == 60.0
    assert hardware.notes == ["15 pictures/s instead of 60: drawing and searching one takes 50 ms of a core here."]


@pytest.mark.parametrize(
    ("cost_ms", "cores", "hz"), [(5.0, 2, 60.0), (20.0, 2, 30.0), (5.0, 1, 60.0), (10.0, 1, 30.0), (500.0, 8, 10.0)]
)
def test_the_rate_follows_from_what_a_picture_costs(cost_ms: float, cores: int, hz: float) -> None:
    assert rate_for(1e-3 * cost_ms, cores) == hz


def test_a_picture_s_cost_is_measured() -> None:
    rate = affordable(Settings(camera={"source": {"kind": "rendered", "rendered": {"task": "still", "seconds": 2.0}}}))
    assert rate.cost_s > 0.0
    assert rate.hz in RATES_HZ
