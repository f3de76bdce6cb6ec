"""Calibrations on a running service: asked on the control socket, answered, published, kept."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from foottrack_protocol.messages import FloorCalibration, FloorValues, HeadPose, MountCalibration, MountValues
from foottrack_service.app import Service
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.errors import ControlError
from foottrack_service.calibration import node as calibration_node
from foottrack_service.calibration.body import BodyFlow
from foottrack_service.calibration.floor import FloorFlow
from foottrack_service.calibration.heading import HeadingFlow
from foottrack_service.calibration.node import CalibrationDesk
from foottrack_service.calibration.store import Store
from foottrack_service.cli.calibrate_person import ask
from foottrack_service.config import BusSettings, Settings
from foottrack_service.simulation import node as simulation
from foottrack_service.simulation import people
from foottrack_service.simulation.posture import Bearing
from foottrack_service.simulation.scenario import simulate
from foottrack_service.simulation.stride import Planner
from foottrack_service.simulation.tasks import TASKS, Task

Run = Callable[..., Any]


def settings_with(**sections: Any) -> Settings:
    return Settings(bus=BusSettings.beginning_at("0").model_dump(), **sections)


@pytest.fixture
def standing(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """A simulated person who stands still, and looks down by so many degrees."""

    def make(settings: Settings, look_down: float, seconds: float) -> Any:
        bearing = Bearing(look_down=np.radians(look_down), gaze_sd=np.radians(0.2), sway_sd=0.002)

        def truth(seconds: float, settings: Settings, feet: Any, random: np.random.Generator) -> Any:
            return people.scene(seconds, settings, feet, random, Planner(random), bearing)

        monkeypatch.setitem(TASKS, "standing", Task("standing", "", seconds, truth))
        return simulate("standing", 3, settings=settings, seconds=seconds, depth=False)

    return make


async def refusal(client: Any, cmd: str, args: dict[str, Any]) -> str:
    with pytest.raises(ControlError) as error:
        await client.request(cmd, args, timeout_s=10.0)
    return str(error.value.code)


def test_the_floor_is_found_published_kept_and_known_to_the_next_service(run: Run, standing, tmp_path) -> None:
    async def scenario() -> None:
        config = settings_with()
        store = Store(tmp_path, "user", "default")
        async with Service(config, store) as service:
            with Bus.connect(service.endpoints) as client:
                results = client.subscriber(["user/calibration"])
                await results.ready()
                control = client.control()
                play = asyncio.ensure_future(simulation.run(service.bus, config, standing(config, 60.0, 4.0)))
                asked = asyncio.ensure_future(control.request("calibrate/floor", {}, timeout_s=10.0))
                found = await asked
                play.cancel()
                async for received in results:
                    assert received.message.data.model_dump() == found
                    assert received.message.src == "calibration"
                    break
        assert found["kind"] == "floor"
        assert abs(found["values"]["height"]) < 0.02
        assert [body.model_dump() for body in store.load()] == [found]
        async with Service(config, store) as service:
            with Bus.connect(service.endpoints) as client:
                results = client.subscriber(["user/calibration"])
                await results.ready()
                async for received in results:
                    assert received.message.data.model_dump() == found
                    return

    run(scenario())


def test_what_fusion_finds_of_the_mount_is_kept_for_the_next_start(run: Run, tmp_path) -> None:
    config = settings_with()
    store = Store(tmp_path, "user", "default")
    values = {"p": (0.01, 0.0, 0.002), "q": (0.0, 0.0, 0.0, 1.0), "sigma_p": 0.001, "sigma_q": 0.001}
    mount = MountCalibration(values=MountValues(**values, base=config.camera.mount_hash))

    async def scenario() -> None:
        async with Service(config, store) as service:
            with Bus.connect(service.endpoints) as client:
                publisher = client.publisher("fusion")
                await publisher.ready()
                for base in ("another", config.camera.mount_hash):
                    found = MountCalibration(values=MountValues(**values, base=base))
                    publisher.publish("user", "calibration", client.clock(), found)
                heard = client.subscriber(["user/calibration"])
                await heard.ready()
                async for received in heard:
                    if received.message.src == "calibration":
                        assert received.message.data == mount
                        break
        assert store.load() == [mount]
        async with Service(config, store) as service:
            with Bus.connect(service.endpoints) as client:
                heard = client.subscriber(["user/calibration"])
                await heard.ready()
                async for received in heard:
                    assert (received.message.src, received.message.data) == ("calibration", mount)
                    return

    run(scenario())


def test_a_slow_disk_holds_nobody_up(run: Run, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is done once the loop, which goes on meanwhile, says so."""
    loop_went_on = threading.Event()
    kept: list[bool] = []
    monkeypatch.setattr(calibration_node, "REPEAT_S", 0.02)
    values = {"p": (0.0, 0.002, 0.0), "q": (0.0, 0.0, 0.0, 1.0), "sigma_p": 0.001, "sigma_q": 0.002}

    async def scenario() -> None:
        loop, done = asyncio.get_running_loop(), asyncio.Event()

        def keep(store: Store, body: Any) -> None:
            loop.call_soon_threadsafe(loop_went_on.set)
            kept.append(loop_went_on.wait(5.0))
            loop.call_soon_threadsafe(done.set)

        monkeypatch.setattr(Store, "keep", keep)
        config = settings_with()
        mount = MountCalibration(values=MountValues(**values, base=config.camera.mount_hash))
        async with Service(config, Store(tmp_path, "user", "default")) as service:
            with Bus.connect(service.endpoints) as other:
                fusion = other.publisher("fusion")
                await fusion.ready()
                fusion.publish("user", "calibration", other.clock(), mount)
                await done.wait()

    run(scenario())
    assert kept == [True]


def test_a_second_calibration_has_to_wait_for_the_first(run: Run, bus: Bus) -> None:
    async def scenario() -> None:
        desk = CalibrationDesk(bus, settings_with())
        first = asyncio.ensure_future(desk.floor())
        await asyncio.sleep(0)
        with pytest.raises(ControlError) as error:
            await desk.heading()
        assert error.value.code == "busy"
        first.cancel()
        await asyncio.wait({first})
        second = asyncio.ensure_future(desk.heading())
        await asyncio.sleep(0)
        assert not second.done()
        second.cancel()
        await asyncio.wait({second})

    run(scenario())


def test_requests_that_cannot_be_are_refused_at_once_and_a_silent_headset_soon(run: Run) -> None:
    async def scenario() -> None:
        async with Service(settings_with()) as service:
            with Bus.connect(service.endpoints) as client:
                control = client.control()
                assert await refusal(control, "calibrate/floor", {"user": "somebody"}) == "unavailable"
                assert await refusal(control, "calibrate/body", {"height": 5.0}) == "bad_arguments"
                assert await refusal(control, "calibrate/mount", {"height": 1.8}) == "bad_arguments"
                assert await refusal(control, "calibrate/heading", {}) == "unavailable"

    run(scenario())


def test_a_floor_that_was_kept_is_the_one_that_a_body_is_measured_from(run: Run, tmp_path) -> None:
    """And the command says what to do, and rings."""

    async def scenario() -> None:
        config = settings_with()
        store = Store(tmp_path, "user", "default")
        store.keep(FloorCalibration(values=FloorValues(height=0.5)))
        said: list[str] = []
        rings: list[None] = []
        async with Service(config, store) as service:
            head = service.bus.publisher("headset")
            await head.ready()

            async def wear() -> None:
                while True:
                    pose = HeadPose(p=(0.0, 2.1, 0.0), q=(0.0, 0.0, 0.0, 1.0), tracked=True)
                    head.publish("user", "head/pose", service.bus.clock(), pose)
                    await asyncio.sleep(0.01)

            worn = asyncio.ensure_future(wear())
            client = config.model_copy(update={"bus": service.endpoints})
            found = await ask(client, "body", {}, BodyFlow(client), 0, said.append, lambda: rings.append(None))
            worn.cancel()
        assert found["values"]["height"] == pytest.approx(1.6 / 0.936)
        assert said[0].startswith("Stand upright") and said[-1] == "Done. Thank you."
        assert "Good. Stay like that." in said
        assert len(rings) == 4

    run(scenario())


def test_the_command_rings_three_times_for_a_refusal(run: Run) -> None:
    async def scenario() -> None:
        config = settings_with()
        rings: list[None] = []
        async with Service(config) as service:
            client = config.model_copy(update={"bus": service.endpoints})
            with pytest.raises(ControlError, match="headset"):
                await ask(client, "floor", {}, FloorFlow(client), 0, lambda _: None, lambda: rings.append(None))
        assert len(rings) == 4

    run(scenario())


@pytest.mark.slow
def test_a_person_who_does_what_is_said_is_calibrated_by_all_three_commands(run: Run, tmp_path) -> None:
    """``foottrack run``, ``foottrack sim --task calibration`` and the three commands, in real time: about 22 s."""

    async def scenario() -> None:
        config = settings_with()
        store = Store(tmp_path, "user", "default")
        heard: dict[str, list[str]] = {}
        found: dict[str, Any] = {}
        async with Service(config, store) as service:
            client = config.model_copy(update={"bus": service.endpoints})
            person = simulate("calibration", 1, settings=config, seconds=60.0, depth=False)
            play = asyncio.ensure_future(simulation.run(service.bus, config, person))
            for kind, flow in (("floor", FloorFlow), ("body", BodyFlow), ("heading", HeadingFlow)):
                said = heard[kind] = []
                found[kind] = (await ask(client, kind, {}, flow(client), 0, said.append, lambda: None))["values"]
            play.cancel()
        assert abs(found["floor"]["height"]) < 0.02
        assert abs(found["heading"]["yaw"]) < 0.05
        assert found["body"]["height"] == pytest.approx(1.75, abs=0.02)
        assert found["body"]["neck_down"] == pytest.approx(0.12, abs=0.012)
        assert {body.kind for body in store.load()} >= {"floor", "body"}
        assert heard["floor"] == [heard["floor"][0], "Done. Thank you."]
        assert "Now take one step forward, and stand still." in heard["heading"]
        assert heard["body"][0].startswith("Stand upright") and "Good. Stay like that." in heard["body"]

    run(scenario())
