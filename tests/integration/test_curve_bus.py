"""CURVE: who has the right keys is let in for his roles, nobody else, and everybody is told why."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from bus_traffic import publish, take
from curve_keys import Keyring
from zmtp import GREETING

from foottrack_protocol.messages import Health
from foottrack_service.app import Service
from foottrack_service.bus import BindFailed, Broker, Bus, ControlServer, ControlTimeout, NotReady, Received
from foottrack_service.bus.door import Doorkeeper
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.security import new_keys
from foottrack_service.cli.watch import drops_of
from foottrack_service.config import BusSettings, Settings

Run = Callable[..., Any]
SOON_S = 0.4
ENDS = {"ingress": "publish", "egress": "subscribe", "control": "control"}


@pytest.fixture
def keyring(tmp_path: Path) -> Keyring:
    """Three clients: one may do everything, the others one thing each."""
    return Keyring(
        tmp_path / "keys",
        {"engine": ("publish", "subscribe", "control"), "screen": ("subscribe",), "sensor": ("publish",)},
    )


@pytest.fixture
def door(keyring: Keyring, context: Context) -> Iterator[Broker]:
    """A broker with encrypted endpoints beside the plain ones."""
    with Broker(keyring.settings, context) as broker:
        yield broker


def refused(broker: Broker) -> int:
    """How many were refused so far."""
    assert broker.doorkeeper is not None
    return broker.doorkeeper.refused.total()


async def told(healths: AsyncIterator[Received], reason: str) -> Health:
    """The first health that says that somebody was turned away for a reason."""
    while True:
        body: Health = (await anext(healths)).message.data
        if body.drops.get(f"door/{reason}"):
            return body


def at(endpoint: str) -> tuple[str, int]:
    """Host and port."""
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    return host, int(port)


def test_encrypted_and_plain_parties_share_one_bus(run: Run, keyring: Keyring, door: Broker, context: Context) -> None:
    async def scenario() -> None:
        with (
            Bus.connect(keyring.client(door, "engine"), context) as remote,
            Bus.connect(door.endpoints, context) as local,
        ):
            for sender, receiver in ((remote, local), (local, remote)):
                publisher, subscriber = sender.publisher("someone"), receiver.subscriber(["user/"])
                await publisher.ready()
                await subscriber.ready()
                publish(publisher, 5)
                assert [received.message.seq for received in await take(subscriber, 5)] == [0, 1, 2, 3, 4]

    run(scenario())
    assert refused(door) == 0


def test_requests_are_answered_over_curve(run: Run, keyring: Keyring, door: Broker, context: Context) -> None:
    async def scenario() -> None:
        server = ControlServer(context, "tcp://127.0.0.1:0", {}, clock=lambda: 42, doorkeeper=door.doorkeeper)
        with Bus.connect(keyring.client(door, "engine"), context) as remote:
            serving = asyncio.ensure_future(server.run())
            try:
                assert await remote.control().request("time") == {"t": 42}
            finally:
                server.close()
                await serving

    run(scenario())


@pytest.mark.parametrize(
    ("name", "role", "told"),
    [
        ("screen", "publish", "does not let the key"),
        ("sensor", "subscribe", "does not let the key"),
        ("stranger", "subscribe", "does not let the key"),
        ("stranger", "publish", "does not let the key"),
        (None, "subscribe", "encrypted connections only"),
        (None, "publish", "encrypted connections only"),
    ],
)
def test_who_may_not_is_refused_with_the_reason(
    name: str | None, role: str, told: str, keyring: Keyring, door: Broker, context: Context
) -> None:
    if name == "stranger":
        new_keys(keyring.folder, name)
    with Bus.connect(keyring.client(door, name), context) as bus:
        end = bus.publisher("x") if role == "publish" else bus.subscriber()
        with pytest.raises(NotReady, match=told):
            end.wait_ready(SOON_S)
        assert end.connections == 0
    assert refused(door) > 0


def test_who_is_not_let_in_is_counted_in_the_health_by_the_reason(run: Run, keyring: Keyring, context: Context) -> None:
    new_keys(keyring.folder, "stranger")

    async def scenario() -> None:
        async with Service(Settings(bus=keyring.settings)) as service:
            subscriber = service.bus.subscriber(["sys/health"])
            await subscriber.ready()
            healths = aiter(subscriber)
            doors = BusSettings(
                **{end: service.encrypted_endpoints[role] for end, role in ENDS.items()}  # type: ignore[index]
            )
            for reason, name in {"key": "stranger", "role": "sensor"}.items():
                curve = keyring.key_settings(name)
                with Bus.connect(doors.model_copy(update={"curve": curve}), context) as bus:
                    bus.subscriber()
                    await told(healths, reason)
            # On a plain socket: a library's client may hang up before its greeting is read.
            with socket.create_connection(at(doors.egress)) as plain:
                plain.sendall(GREETING)
                await told(healths, "not_encrypted")
            with socket.create_connection(at(doors.egress)) as leaves:
                leaves.sendall(GREETING[:5])
            body = await told(healths, "handshake")
            reasons = {"key", "role", "not_encrypted", "handshake"}
            assert {key for key in body.drops if key.startswith("door/")} == {f"door/{reason}" for reason in reasons}
            assert drops_of(body)["door"].keys() == reasons

    run(scenario())


def test_a_role_that_is_named_is_given(keyring: Keyring, door: Broker, context: Context) -> None:
    with Bus.connect(keyring.client(door, "sensor"), context) as bus:
        bus.publisher("imu-left").wait_ready()
    with Bus.connect(keyring.client(door, "screen"), context) as bus:
        bus.subscriber().wait_ready()
    assert refused(door) == 0


def test_another_services_key_is_told_on_both_sides(
    keyring: Keyring, door: Broker, context: Context, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    other = new_keys(tmp_path, "other").public
    with (
        caplog.at_level(logging.WARNING),
        Bus.connect(keyring.client(door, "engine", service=other), context) as bus,
        pytest.raises(NotReady, match=r"another key than \[bus\.curve\] service"),
    ):
        bus.subscriber().wait_ready(SOON_S)
    assert refused(door) > 0
    assert f"ours is {keyring.service}" in caplog.text


def test_the_service_names_who_was_refused_and_why(
    keyring: Keyring, door: Broker, context: Context, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        caplog.at_level(logging.WARNING),
        Bus.connect(keyring.client(door, "screen"), context) as bus,
        pytest.raises(NotReady),
    ):
        bus.publisher("x").wait_ready(SOON_S)
    assert "127.0.0.1 was not let in to publish" in caplog.text
    assert "roles of screen" in caplog.text


def test_curve_at_a_plain_port_is_told(run: Run, keyring: Keyring, door: Broker, context: Context) -> None:
    settings = keyring.client(door, "engine").model_copy(update={"egress": door.endpoints.egress})

    async def scenario() -> None:
        with Bus.connect(settings, context) as bus, pytest.raises(NotReady, match="does not speak CURVE"):
            await bus.subscriber().ready(SOON_S)

    run(scenario())


def test_a_request_without_keys_says_what_is_missing(
    run: Run, keyring: Keyring, door: Broker, context: Context
) -> None:
    async def scenario() -> None:
        server = ControlServer(context, "tcp://127.0.0.1:0", {}, doorkeeper=door.doorkeeper)
        try:
            with (
                Bus.connect(keyring.client(door, None), context) as bus,
                pytest.raises(ControlTimeout, match="encrypted connections only"),
            ):
                await bus.control().request("hello", timeout_s=SOON_S)
        finally:
            server.close()

    run(scenario())


def test_nobody_at_all_is_told_as_before(context: Context) -> None:
    with (
        Bus.connect(BusSettings(egress="tcp://127.0.0.1:9"), context) as bus,
        pytest.raises(NotReady, match="is the service running"),
    ):
        bus.subscriber().wait_ready(SOON_S)


class Wiretap:
    """Passes bytes between a client and an endpoint, and keeps a copy of all of them."""

    def __init__(self, endpoint: str) -> None:
        host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
        self._target = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        self.heard = bytearray()
        self._open: list[socket.socket] = [self._listener]
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """Hang up."""
        for each in self._open:
            each.close()

    def _accept(self) -> None:
        try:
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(self._target)
                self._open += [near, far]
                for ends in ((near, far), (far, near)):
                    threading.Thread(target=self._copy, args=ends, daemon=True).start()
        except OSError:
            return

    def _copy(self, source: socket.socket, target: socket.socket) -> None:
        try:
            while data := source.recv(65536):
                self.heard += data
                target.sendall(data)
        except OSError:
            return


@pytest.mark.parametrize("encrypted", [True, False])
def test_an_eavesdropper_reads_nothing(encrypted: bool, keyring: Keyring, door: Broker, context: Context) -> None:
    """The plain connection shows that the wiretap would hear it."""
    settings = keyring.client(door, "engine") if encrypted else door.endpoints
    tap = Wiretap(settings.egress)
    try:
        with (
            Bus.connect(settings.model_copy(update={"egress": tap.endpoint}), context) as remote,
            Bus.connect(door.inproc, context) as local,
        ):
            subscriber, publisher = remote.subscriber(["user/"]), local.publisher("lighthouse")
            subscriber.wait_ready()
            publisher.wait_ready()
            publish(publisher, 3)
            received: list[Any] = []
            while len(received) < 3:
                received += subscriber.drain()
        telling = [b"user/", b"sys/welcome", b"truth", b"lighthouse", received[0].raw[1]]
        assert [word in tap.heard for word in telling] == [not encrypted] * len(telling)
        assert len(tap.heard) > 3 * len(received[0].raw[1])
    finally:
        tap.close()


def test_encrypted_ports_are_free_after_the_end(keyring: Keyring, context: Context) -> None:
    settings = keyring.settings
    for _ in range(3):
        with Broker(settings, context) as broker:
            assert broker.doorkeeper is not None
            ends = dict(broker.doorkeeper.endpoints)
            server = ControlServer(context, "tcp://127.0.0.1:0", {}, doorkeeper=broker.doorkeeper)
            server.close()
        for role in ("publish", "subscribe"):
            host, _, port = ends[role].removeprefix("tcp://").rpartition(":")
            socket.create_server((host, int(port))).close()


def test_a_second_doorkeeper_of_a_context_is_refused(keyring: Keyring, door: Broker, context: Context) -> None:
    with pytest.raises(BindFailed, match="doorkeeper already"):
        Doorkeeper(context, keyring.settings.curve).start()
