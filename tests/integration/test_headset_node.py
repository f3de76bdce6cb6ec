"""The headset node on a live bus: datagrams over loopback, and runtimes that are not there."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foottrack_service import rotations
from foottrack_service.app import NODES
from foottrack_service.bus import Bus
from foottrack_service.config import Settings
from foottrack_service.headset import node
from foottrack_service.headset.devices.vmc import VmcSender
from foottrack_service.headset.rigid import rigid
from foottrack_service.headset.sources.polled import HeadsetError

Run = Callable[[Any], Any]
HEAD = rigid((0.2, 1.6, -0.3), rotations.from_yaw(0.8))


def settings(**headset: Any) -> Settings:
    return Settings(headset=headset)


@pytest.fixture
def udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def tell(report: Callable[..., None], failed: asyncio.Event) -> Callable[..., None]:
    """Also says when the truth's runtime was not there."""

    def node(name: str, state: str, error: str | None = None) -> None:
        report(name, state, error)
        if (name, state) == ("truth", "restarting"):
            assert error is not None and "is it running" in error
            failed.set()

    return node


async def ended(*tasks: asyncio.Future[Any]) -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def test_vmc_becomes_head_pose_and_silence_a_loss(run: Run, bus: Bus, udp_port: int) -> None:
    given = settings(source="vmc", vmc={"port": udp_port})
    sender = VmcSender()

    async def play() -> None:
        subscriber = bus.subscriber(["user/head"])
        await subscriber.ready()
        task = asyncio.ensure_future(node.run(bus, given))
        await bus.health.wait_running(node.SOURCE)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            out.sendto(b"not osc at all", ("127.0.0.1", udp_port))
            out.sendto(sender.datagram(0.0, HEAD), ("127.0.0.1", udp_port))
            poses = aiter(subscriber)
            for k in range(1, 30):
                message = (await anext(poses)).message
                while not message.data.tracked:  # a machine that stalls is silent, too
                    message = (await anext(poses)).message
                assert message.src == "headset"
                np.testing.assert_allclose(message.data.p, HEAD.p, atol=1e-6)
                assert 0 <= message.t_pub - message.t < 10**9
                await asyncio.sleep(0.011)
                out.sendto(sender.datagram(0.011 * k, HEAD), ("127.0.0.1", udp_port))
            while message.data.tracked:
                message = (await anext(poses)).message
        health = bus.health.body().filters["user/headset"]
        assert health.accepted["poses"] >= 29
        assert health.rejected["not_osc"] == 1
        await ended(task)

    run(play())


def test_a_port_that_is_taken_is_said(run: Run, bus: Bus) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        given = settings(source="vmc", vmc={"port": other.getsockname()[1]})
        with pytest.raises(ExceptionGroup) as failure:
            run(node.run(bus, given))
        assert "for VMC" in str(failure.value.exceptions[0])


def test_left_to_the_bus_it_ends_at_once_and_is_not_wanted(run: Run, bus: Bus) -> None:
    run(node.run(bus, Settings()))
    devices = {"imu", "headset", "camera"}
    assert not [name for name in devices if NODES[name].wanted(Settings())]
    every = Settings(
        headset={"source": "vmc"}, imu={"left": {"format": "rvc"}}, camera={"source": {"kind": "rendered"}}
    )
    assert all(NODES[name].wanted(every) for name in devices)


def test_openvr_publishes_head_and_truth(run: Run, bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    from openvr_double import RUNNING_OK, Runtime

    from foottrack_service.headset.sources import openvr

    foot = rigid((-0.1, 0.1, 0.0), rotations.from_yaw(0.1))
    runtime = Runtime(("hmd", HEAD, RUNNING_OK), ("LHR-A", foot, RUNNING_OK))
    monkeypatch.setattr(openvr, "_package", lambda: runtime)

    async def play() -> None:
        subscriber = bus.subscriber(["user/"])
        await subscriber.ready()
        task = asyncio.ensure_future(node.run(bus, settings(source="openvr", openvr={"truth_left": "LHR-A"})))
        seen: dict[str, list[Any]] = {"head/pose": [], "truth/left": []}
        async for received in subscriber:
            seen[received.message.stream].append(received.message)
            if min(map(len, seen.values())) >= 5:
                break
        for message in seen["head/pose"]:
            np.testing.assert_allclose(message.data.p, HEAD.p)
        np.testing.assert_allclose(seen["truth/left"][-1].data.p, foot.p)
        runtime.events.append(runtime.VREvent_Quit)
        with pytest.raises(ExceptionGroup) as failure:
            await task
        assert isinstance(failure.value.exceptions[0], HeadsetError)

    run(play())
    assert runtime.told == ["exiting", "shutdown"]


@pytest.mark.parametrize("source", ["openvr", "openxr"])
def test_a_runtime_that_is_not_there_is_said(
    run: Run, bus: Bus, source: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With the extra installed or not: what to do is in the error."""
    monkeypatch.setenv("XR_RUNTIME_JSON", str(tmp_path / "none.json"))
    with pytest.raises(ExceptionGroup) as failure:
        run(node.run(bus, settings(source=source)))
    error = failure.value.exceptions[0]
    assert isinstance(error, HeadsetError)
    package = {"openvr": "openvr", "openxr": "xr"}[source]
    assert ("is it running" if find_spec(package) else f"foottrack[{source}]") in str(error)


def test_truth_without_steamvr_disturbs_no_head(
    run: Run, bus: Bus, udp_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from openvr_double import Runtime

    from foottrack_service.headset.sources import openvr

    runtime, failed = Runtime(), asyncio.Event()
    runtime.running = False
    monkeypatch.setattr(openvr, "_package", lambda: runtime)
    monkeypatch.setattr(bus.health, "node", tell(bus.health.node, failed))
    given = settings(source="vmc", vmc={"port": udp_port}, openvr={"truth_left": "LHR-A"})

    async def play() -> None:
        task = asyncio.ensure_future(node.run(bus, given))
        await bus.health.wait_running(node.SOURCE)
        await failed.wait()
        assert not task.done()
        await ended(task)

    run(play())
