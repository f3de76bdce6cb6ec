"""The bridges on a live bus: paced datagrams at their targets, and a farewell."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest
from pythonosc.osc_packet import OscPacket

from foottrack_protocol.messages import BodyPose, FootPose, Pose
from foottrack_service.bridges import node
from foottrack_service.bus import Bus
from foottrack_service.config import Settings

Run = Callable[..., Any]
FOOT = FootPose(
    ankle=Pose(p=(0.0, 0.1, 0.0), q=(0.0, 0.0, 0.0, 1.0)),
    toe=(0.0, 0.02, -0.2),
    v=(0.0, 0.0, 0.0),
    contact=True,
    stage="inertial",
    sigma=0.1,
)
BODY = BodyPose(left=FOOT)


@pytest.fixture
def application() -> Iterator[socket.socket]:
    """Somebody who listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.setblocking(False)
        yield listening


async def heard(application: socket.socket) -> bytes:
    """The next datagram."""
    return await asyncio.get_running_loop().sock_recv(application, 2048)


def vmt(application: socket.socket, **more: Any) -> Settings:
    """Settings that send trackers there."""
    return Settings(bridges={"vmt": {"enabled": True, "port": application.getsockname()[1], **more}})


def test_poses_become_datagrams_until_the_farewell(run: Run, bus: Bus, application: socket.socket) -> None:
    async def scenario() -> None:
        running = asyncio.ensure_future(node.run(bus, vmt(application)))
        publisher = bus.publisher("fusion")
        await publisher.ready()
        await bus.health.wait_running("bridges")
        publisher.publish("user", "pose/body", 0, BODY)
        assert b"/VMT/Room/Unity" in await heard(application)
        # Not healthy, somebody else's, too early: none of them.
        publisher.publish("user", "pose/body", 1_000_000_000, BODY, valid=False)
        publisher.publish("other", "pose/body", 1_000_000_000, BODY)
        publisher.publish("user", "pose/body", 5_000_000, BODY)
        publisher.publish("user", "pose/body", 2_000_000_000, BODY)
        shown = await heard(application)
        running.cancel()
        with suppress(asyncio.CancelledError):
            await running
        farewell = await heard(application)
        assert [OscPacket(told).messages[0].message.params[1] for told in (shown, farewell)] == [1, 0]
        with pytest.raises(BlockingIOError):
            application.recv(2048)

    run(scenario())


def test_without_bridges_the_node_ends(run: Run, bus: Bus) -> None:
    run(node.run(bus, Settings()))


def test_a_target_that_is_not_known_is_told(run: Run, bus: Bus, application: socket.socket) -> None:
    with pytest.raises(OSError, match=r"\[bridges\.vmt\] host 'no\.such\.host\.invalid'"):
        run(node.run(bus, vmt(application, host="no.such.host.invalid")))
