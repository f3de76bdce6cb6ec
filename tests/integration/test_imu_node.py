"""Simulated devices at the other end of a pty or a socket, through the node, onto the bus."""

from __future__ import annotations

import asyncio
import math
import socket
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worn_imus import TILT, Datagrams, Wearer, stopped

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import Imu
from foottrack_service import rotations
from foottrack_service.bus import Bus, Publisher
from foottrack_service.config import Settings
from foottrack_service.imu import node
from foottrack_service.imu.devices.slimevr import SlimeVrDevice
from foottrack_service.imu.formats import slimevr


class Listener:
    """Counts what comes on the bus, by stream."""

    def __init__(self, bus: Bus) -> None:
        self.subscriber = bus.subscriber(["user/imu/"])
        self.messages: dict[str, list[Any]] = {"imu/left": [], "imu/right": []}

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(15.0):
            while not condition():
                for received in self.subscriber.drain():
                    self.messages[received.message.stream].append(received.message)
                await asyncio.sleep(0.005)

    def count(self, side: str) -> int:
        return len(self.messages[f"imu/{side}"])


def check_at_rest(message: Any, has_gyro: bool, has_q: bool) -> None:
    imu = message.data
    assert isinstance(imu, Imu)
    up = rotations.rotate(TILT, imu.acc)
    np.testing.assert_allclose(up, [0.0, STANDARD_GRAVITY, 0.0], atol=0.02)
    assert (imu.gyro is not None) == has_gyro
    assert (imu.q is not None) == has_q
    if imu.q is not None:
        assert rotations.angle_between(imu.q, TILT) < 1e-3
    if imu.gyro is not None:
        np.testing.assert_allclose(imu.gyro, [0.1, 0.2, 0.3], atol=0.002)
    assert message.t <= imu.t_arr <= message.t_pub


CASES = [("ascii", False, True), ("rvc", False, True), ("bno08x", True, True), ("raw", True, False)]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
@pytest.mark.parametrize(("name", "has_gyro", "has_q"), CASES)
def test_from_bytes_to_the_bus(name: str, has_gyro: bool, has_q: bool, tmp_path: Path, bus: Bus, run: Any) -> None:
    async def scenario() -> None:
        wearer = Wearer(tmp_path / "left", name)
        wearer.plug()
        settings = Settings(imu={"left": {"format": name, "port": str(tmp_path / "left"), "delay": 0.002}})
        listener = Listener(bus)
        await listener.subscriber.ready()
        tasks = [asyncio.create_task(node.run(bus, settings)), asyncio.create_task(wearer.run())]
        await listener.until(lambda: listener.count("left") >= 40)
        await stopped(*tasks)
        wearer.unplug()
        messages = listener.messages["imu/left"]
        for message in messages:
            check_at_rest(message, has_gyro, has_q)
            assert message.src == "imu-left"
            assert message.data.t_arr - message.t >= 2_000_000
        assert [message.seq for message in messages] == list(range(len(messages)))
        assert all(a.t <= b.t for a, b in pairwise(messages))

    run(scenario())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
def test_one_foot_unplugged_does_not_disturb_the_other(tmp_path: Path, bus: Bus, run: Any) -> None:
    async def scenario() -> None:
        left, right = Wearer(tmp_path / "left", "bno08x"), Wearer(tmp_path / "right", "raw")
        left.plug()
        right.plug()
        settings = Settings(
            imu={
                "left": {"format": "bno08x", "port": str(tmp_path / "left"), "rate": 200},
                "right": {"format": "raw", "port": str(tmp_path / "right")},
            }
        )
        listener = Listener(bus)
        await listener.subscriber.ready()
        tasks = [
            asyncio.create_task(node.run(bus, settings)),
            asyncio.create_task(left.run()),
            asyncio.create_task(right.run()),
        ]
        await listener.until(lambda: min(listener.count("left"), listener.count("right")) >= 20)
        left.unplug()
        await listener.until(lambda: _state(bus, "imu-left") == "restarting")
        so_far, right_so_far = listener.count("left"), listener.count("right")
        await listener.until(lambda: listener.count("right") >= right_so_far + 50)
        assert listener.count("left") <= so_far + 5
        left.plug()
        await listener.until(lambda: listener.count("left") >= so_far + 20)
        await listener.until(lambda: _state(bus, "imu-left") == "running")
        await stopped(*tasks)
        left.unplug()
        right.unplug()
        # Nothing was lost of the other, nor was it late.
        rights = [message.data.t_dev for message in listener.messages["imu/right"]]
        assert max(b - a for a, b in pairwise(rights)) < 500_000
        assert bus.health.body().nodes["imu-left"].restarts == 1

    run(scenario())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
def test_what_a_device_sends_and_nobody_can_use_is_in_the_health(tmp_path: Path, bus: Bus, run: Any) -> None:
    def counts() -> tuple[dict[str, int], dict[str, int]]:
        found = bus.health.body().filters.get("user/imu-left")
        return ({}, {}) if found is None else (found.accepted, found.rejected)

    async def scenario() -> None:
        wearer = Wearer(tmp_path / "left", "rvc")
        wearer.plug()
        settings = Settings(imu={"left": {"format": "rvc", "port": str(tmp_path / "left")}})
        listener = Listener(bus)
        await listener.subscriber.ready()
        tasks = [asyncio.create_task(node.run(bus, settings)), asyncio.create_task(wearer.run())]
        await listener.until(lambda: listener.count("left") >= 20)
        # A packet whose sum is wrong.
        wearer.say(b"\xaa\xaa" + bytes(16) + b"\x01")
        await listener.until(lambda: counts()[1].get("checksum") == 1)
        assert counts()[0]["imu"] >= 20
        await stopped(*tasks)
        wearer.unplug()

    run(scenario())


def _state(bus: Bus, name: str) -> str | None:
    health = bus.health.body().nodes.get(name)
    return None if health is None else health.state


@pytest.fixture
def udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_slimevr_trackers_come_over_udp(bus: Bus, run: Any, udp_port: int) -> None:
    async def scenario() -> None:
        macs = {"left": "A0:00:00:00:00:01", "right": "A0:00:00:00:00:02"}
        settings = Settings(
            imu={
                "slimevr_host": "127.0.0.1",
                "slimevr_port": udp_port,
                "left": {"format": "slimevr", "port": macs["left"].lower()},
                "right": {"format": "slimevr"},
            }
        )
        listener = Listener(bus)
        await listener.subscriber.ready()
        loop = asyncio.get_running_loop()
        tasks = [asyncio.create_task(node.run(bus, settings))]
        await listener.until(lambda: _state(bus, "imu-left") == "starting")
        trackers = []
        for mac in macs.values():
            transport, tracker = await loop.create_datagram_endpoint(
                lambda mac=mac: Datagrams(SlimeVrDevice(mac)), remote_addr=("127.0.0.1", udp_port)
            )
            trackers.append(transport)
            tasks.append(asyncio.create_task(tracker.run()))
        await listener.until(lambda: min(listener.count("left"), listener.count("right")) >= 20)
        await listener.until(lambda: _state(bus, "imu-left") == "running")
        await stopped(*tasks)
        for transport in trackers:
            transport.close()
        for side in macs:
            for message in listener.messages[f"imu/{side}"]:
                check_at_rest(message, has_gyro=False, has_q=True)
                assert message.data.t_dev is None

    run(scenario())


def test_each_foot_s_tracker_is_turned_as_its_own_setting_says(bus: Bus, run: Any, udp_port: int) -> None:
    """The right one's accelerations are turned by half a turn about its z: flat, with 3 m/s^2 along its x."""
    macs = {"left": "AA:00:00:00:00:01", "right": "AA:00:00:00:00:02"}
    turns = {"left": 0.0, "right": math.pi}
    devices = {side: {"format": "slimevr", "port": mac, "acc_turn": turns[side]} for side, mac in macs.items()}
    settings = Settings(imu={**devices, "slimevr_host": "127.0.0.1", "slimevr_port": udp_port})

    async def scenario() -> None:
        listener = Listener(bus)
        await listener.subscriber.ready()
        running = asyncio.create_task(node.run(bus, settings))
        await listener.until(lambda: _state(bus, "imu-left") == "starting")
        loop = asyncio.get_running_loop()
        for side, mac in macs.items():
            transport, _ = await loop.create_datagram_endpoint(
                asyncio.DatagramProtocol, remote_addr=("127.0.0.1", udp_port)
            )
            transport.sendto(slimevr.encode_handshake(slimevr.Handshake(22, "test", mac)))
            both = [slimevr.encode_rotation(0, slimevr.Rotation(0, (0.0, 0.0, 0.0, 1.0), 3))]
            both.append(slimevr.encode_acceleration(0, slimevr.Acceleration(0, (3.0, 0.0, 0.0))))
            transport.sendto(slimevr.encode_bundle(1, both))
            await listener.until(lambda side=side: listener.count(side) >= 1)  # type: ignore[misc]
            transport.close()
        await stopped(running)
        felt = {side: listener.messages[f"imu/{side}"][0].data.acc[0] for side in macs}
        assert felt == pytest.approx({"left": 3.0, "right": -3.0})

    run(scenario())


def test_a_port_that_is_taken_costs_no_socket_however_often_it_is_tried(bus: Bus, run: Any, udp_port: int) -> None:
    """SlimeVR's own server has it, and the service tries again every 10 s for as long as it runs."""
    settings = Settings(imu={"left": {"format": "slimevr"}, "slimevr_host": "127.0.0.1", "slimevr_port": udp_port})
    made: list[Publisher] = []

    class Counted(Bus):
        def publisher(self, src: str) -> Publisher:
            made.append(super().publisher(src))
            return made[-1]

    async def scenario() -> None:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as theirs,
            Counted.connect(bus.settings, bus.context) as counted,
        ):
            theirs.bind(("127.0.0.1", udp_port))
            for _ in range(3):
                with pytest.raises(ExceptionGroup, match="TaskGroup") as caught:
                    await node.run(counted, settings)
                assert caught.group_contains(OSError, match="for SlimeVR trackers")
            assert len(made) == 3 and all(publisher.closed for publisher in made)

    run(scenario())


def test_without_devices_the_node_ends(bus: Bus, run: Any) -> None:
    run(node.run(bus, Settings()))
