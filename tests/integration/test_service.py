"""The service as a whole: sensors in, poses out at a subscriber, and what happens when a part of it ends."""

from __future__ import annotations

import asyncio
import logging
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foottrack_protocol import encode
from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import CameraPreview, HeadPose, Imu, Optical
from foottrack_service.app import NODES, Node, Service, recorder_node
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.errors import NodeFailed
from foottrack_service.cli.service import _one_node
from foottrack_service.config import BusSettings, Settings
from foottrack_service.evaluation import datasets
from foottrack_service.evaluation.truth import TruthTrack
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.offline import fuse
from foottrack_service.recording.errors import WriteError
from foottrack_service.recording.reader import open_recording
from foottrack_service.recording.writer import RecordingWriter
from foottrack_service.simulation import node as simulation
from foottrack_service.simulation.scenario import simulate

Run = Callable[..., Any]
DATA = Path(os.environ.get("FOOTTRACK_DATA", Path(__file__).parents[3] / "shared" / "data"))
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def settings_with(**sections: Any) -> Settings:
    return Settings(**{"bus": BusSettings.beginning_at("0").model_dump(), **sections})


async def poses_until(subscriber: Any, done: asyncio.Future[Any]) -> list[Any]:
    """What a subscriber of pose/body receives until something else is done."""
    poses: list[Any] = []

    async def collect() -> None:
        async for received in subscriber:
            poses.append(received.message)

    task = asyncio.ensure_future(collect())
    await done
    task.cancel()
    await asyncio.wait({task})
    return poses


def test_a_simulated_person_s_feet_come_out_at_a_subscriber(run: Run) -> None:
    async def scenario() -> None:
        config = settings_with()
        person = simulate("steps", 11, settings=config, seconds=5.0)
        async with Service(config) as service:
            service.start(NODES["fusion"])
            await service.running("fusion")
            with Bus.connect(service.endpoints) as engine:
                subscriber = engine.subscriber(["user/pose/body", "user/truth/"])
                await subscriber.ready()
                received = await poses_until(
                    subscriber, asyncio.ensure_future(simulation.run(service.bus, config, person))
                )
                assert all(stats.gaps == 0 for stats in subscriber.stats.topics.values())
        poses = [message for message in received if message.stream == "pose/body"]
        assert len(poses) > 250  # a stalled machine gives one for several samples
        assert [pose.seq for pose in poses] == list(range(poses[0].seq, poses[0].seq + len(poses)))
        for side in ("left", "right"):
            truth = [message for message in received if message.stream == f"truth/{side}"]
            track = TruthTrack([m.t for m in truth], [m.data.p for m in truth], [m.data.q for m in truth])
            feet = [(pose.t, getattr(pose.data, side)) for pose in poses]
            seen = [(t, foot) for t, foot in feet if foot is not None and foot.age is not None]
            t = np.array([stamp for stamp, _ in seen])
            errors = np.linalg.norm(np.array([foot.ankle.p for _, foot in seen]) - track.position(t), axis=1)
            assert np.median(errors[track.covers(t)]) < 0.06
            assert {"marker"} <= {foot.stage for _, foot in seen}
            assert np.mean([foot.knee is not None for _, foot in seen]) > 0.9

    run(scenario())


def test_a_publisher_that_dies_and_comes_back_is_no_gap_and_fusion_goes_on(run: Run) -> None:
    async def scenario() -> None:
        config = settings_with()
        async with Service(config) as service:
            service.start(NODES["fusion"])
            await service.running("fusion")
            with Bus.connect(service.endpoints) as device, Bus.connect(service.endpoints) as engine:
                subscriber = engine.subscriber(["user/pose/body"])
                await subscriber.ready()
                runs = []
                for _ in range(2):
                    publisher = device.publisher("imu-left")
                    await publisher.ready()
                    runs.append(await _poses_of_a_still_foot(device, publisher, subscriber))
                    publisher.close()
                health = service.bus.health.body()
        assert runs == [20, 20]
        assert health.filters["user/left"].accepted["imu"] > 0
        assert all(topic.gaps == 0 for topic in health.topics.values())

    run(scenario())


async def _poses_of_a_still_foot(bus: Any, publisher: Any, subscriber: Any) -> int:
    """Publish a sample, wait for a pose with the foot, and again, 20 times."""
    poses = 0
    publisher.publish("user", "imu/left", bus.clock(), _still(bus.clock()))
    async for received in subscriber:
        poses += received.message.data.left is not None
        if poses == 20:
            break
        publisher.publish("user", "imu/left", bus.clock(), _still(bus.clock()))
    return poses


def _still(now: int) -> Imu:
    return Imu(acc=(0.0, STANDARD_GRAVITY, 0.0), q=UPRIGHT, t_arr=now)


def test_a_vital_node_that_fails_ends_the_service_with_its_reason(run: Run) -> None:
    async def scenario() -> None:
        async def broken(bus: Bus, settings: Settings) -> None:
            raise ZeroDivisionError("a bug")

        async with Service(settings_with()) as service:
            service.start(Node("broken", broken, vital=True))
            with pytest.raises(NodeFailed, match="broken: ZeroDivisionError: a bug"):
                await service.failed()
            assert service.bus.health.body().nodes["broken"].state == "failed"

    run(scenario())


def test_a_device_node_that_fails_is_started_again_and_says_so(run: Run) -> None:
    async def scenario() -> None:
        starts: list[int] = []
        again = asyncio.get_running_loop().create_future()

        async def flaky(bus: Bus, settings: Settings) -> None:
            starts.append(1)
            if len(starts) == 1:
                raise OSError("unplugged")
            bus.health.node("flaky", "running")
            again.set_result(None)
            await asyncio.Event().wait()

        async with Service(settings_with()) as service:
            service.start(Node("flaky", flaky))
            await again
            assert service.bus.health.body().nodes["flaky"].restarts == 1

    run(scenario())


def test_a_recording_replays_offline_to_the_same_bytes(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "steps.mcap"

    async def scenario() -> None:
        config = settings_with()
        person = simulate("line", 3, settings=config, seconds=3.0)
        async with Service(config) as service:
            for node in (NODES["fusion"], recorder_node(path)):
                service.start(node)
                await service.running(node.name)
            await simulation.run(service.bus, config, person)

    run(scenario())
    recording = open_recording(path)
    arrivals = [(recorded.arrival, recorded.message) for recorded in recording.messages()]
    topics = {message.topic for _, message in arrivals}
    assert {"user/imu/left", "user/marker/right", "user/head/pose", "user/truth/left", "user/pose/body"} <= topics
    first, second = ([encode(out) for out in fuse(arrivals, FusionCore(Settings()))] for _ in range(2))
    assert len(first) > 250
    assert first == second


@pytest.mark.real
@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings are not here (FOOTTRACK_DATA)")
@pytest.mark.parametrize("name", ["gaitmap", "pyshoe"])
def test_real_feet_come_out_live_at_their_own_rate(run: Run, name: str) -> None:
    """The first seconds of a real recording on a live bus, raw axes, without headset and camera."""
    if name == "gaitmap":
        trials = datasets.gaitmap(DATA / "gaitmap")
    else:
        trials = [datasets.pyshoe(min((DATA / "llio_pyshoe_vicon_dev").glob("*.npz")))]
    seconds = 6.0

    async def scenario() -> None:
        config = datasets.settings_with(trials, settings_with())
        async with Service(config) as service:
            service.start(NODES["fusion"])
            await service.running("fusion")
            with Bus.connect(service.endpoints) as device, Bus.connect(service.endpoints) as engine:
                subscriber = engine.subscriber(["user/pose/body"])
                publisher = device.publisher("imu")
                await subscriber.ready()
                await publisher.ready()
                poses = await poses_until(subscriber, asyncio.ensure_future(_play(device, publisher, trials, seconds)))
                assert subscriber.stats.topics["user/pose/body"].gaps == 0
            health = service.bus.health.body()
        assert len(poses) > 100 * seconds
        for trial in trials:
            feet = [getattr(pose.data, trial.side) for pose in poses]
            assert sum(foot is not None for foot in feet) > 90 * seconds
            assert all(math.isfinite(sum(foot.ankle.p)) for foot in feet if foot is not None)
            expected = int(np.sum(trial.t < seconds))
            assert health.filters[f"user/{trial.side}"].accepted["imu"] > 0.8 * expected
        assert all(pose.data.head is None and pose.data.hips is None for pose in poses)

    run(scenario())


async def _play(bus: Any, publisher: Any, trials: Any, seconds: float) -> None:
    start = bus.clock()
    for t, message in datasets.messages(trials, Settings(), start):
        if (t - start) * 1e-9 > seconds:
            return
        wait = (t - bus.clock()) * 1e-9
        if wait > 0:
            await asyncio.sleep(wait)
        publisher.publish(message.user, message.stream, t, message.data)


def test_feet_without_imu_come_by_head_and_tags(run: Run) -> None:
    async def scenario() -> None:
        config = settings_with()
        async with Service(config) as service:
            service.start(NODES["fusion"])
            await service.running("fusion")
            with Bus.connect(service.endpoints) as device, Bus.connect(service.endpoints) as engine:
                subscriber = engine.subscriber(["user/pose/body"])
                publisher = device.publisher("camera")
                await subscriber.ready()
                await publisher.ready()
                head = HeadPose(p=(0.0, 1.6, 0.0), q=UPRIGHT, tracked=True)
                seen = Optical(p=(0.1, -1.5, -0.15), cov=(1e-5, 0, 0, 1e-5, 0, 1e-5), edge_px=100.0, frame=0)
                publisher.publish("user", "head/pose", bus_time := device.clock(), head)
                async for received in subscriber:
                    now = device.clock()
                    publisher.publish("user", "head/pose", now, head)
                    publisher.publish("user", "marker/right", bus_time, seen)
                    bus_time = now
                    right = received.message.data.right
                    if right is not None and right.stage == "marker":
                        assert right.ankle.p[0] == pytest.approx(0.1, abs=0.02)
                        return

    run(scenario())


def test_a_node_in_a_process_of_its_own_tells_its_trouble_on_the_bus(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    async def noisy(bus: Bus, settings: Settings) -> None:
        logging.getLogger("foottrack_service.imu.node").warning("imu-left dropped: 3 checksum")
        await asyncio.Event().wait()

    monkeypatch.setitem(NODES, "imu", Node("imu", noisy))

    async def scenario() -> None:
        async with Service(settings_with()) as service:
            told = service.bus.subscriber(["sys/log"])
            await told.ready()
            node = asyncio.ensure_future(_one_node("imu", settings_with(bus=service.endpoints.model_dump())))
            async for received in told:
                if received.message.src == "imu":
                    assert received.message.data.message == "imu-left dropped: 3 checksum"
                    break
            node.cancel()
            await asyncio.gather(node, return_exceptions=True)

    run(scenario())


def test_a_node_in_a_process_of_its_own_ends_before_its_bus(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[Any] = []

    async def thorough(bus: Bus, settings: Settings) -> None:
        publisher = bus.publisher("imu-left")
        await publisher.ready()
        bus.health.node("imu-left", "running")
        began.set()
        try:
            await asyncio.Event().wait()
        finally:
            # Its last words need the bus.
            await asyncio.sleep(0)
            ended.append(publisher.publish("user", "camera/preview", bus.clock(), CameraPreview(jpeg=b"bye")))

    monkeypatch.setitem(NODES, "imu", Node("imu", thorough))
    began = asyncio.Event()

    async def scenario() -> None:
        async with Service(settings_with()) as service:
            node = asyncio.ensure_future(_one_node("imu", settings_with(bus=service.endpoints.model_dump())))
            await began.wait()
            node.cancel()
            await asyncio.wait({node})
            assert node.cancelled()
            assert len(ended) == 1

    run(scenario())


def test_a_recording_that_ended_badly_does_not_keep_the_service_from_ending(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(writer: RecordingWriter) -> None:
        raise WriteError(writer.path, "the disk was pulled out")

    async def scenario() -> None:
        config = settings_with(recording={"folder": tmp_path})
        async with Service(config) as service:
            with Bus.connect(service.endpoints) as other:
                await other.control().request("record/start", {"name": "walk"})
            close = RecordingWriter.close
            monkeypatch.setattr(RecordingWriter, "close", lambda writer: (close(writer), refuse(writer)))
        # The ports are free again.
        async with Service(settings_with(bus=service.endpoints.model_dump())):
            pass

    run(scenario())
