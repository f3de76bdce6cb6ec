"""A peer that breaks ZMTP on the bus's ports, and goes: whoever met it finds the bus that comes after it."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from bus_traffic import publish, take
from curve_keys import Keyring
from free_ports import three_free_ports
from zmtp import GREETING

from foottrack_service.bus import Broker, Bus, ControlServer
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.revival import Revival
from foottrack_service.bus.security import new_keys
from foottrack_service.config import BusSettings
from foottrack_service.curve_settings import CurveClient, CurveSettings
from foottrack_service.relay import Relay

Run = Callable[..., Any]
CUT_SHORT = b"\x05READY\x0bSocket-Type\x00\x00\x00\x09XPUB"
RUDE = {
    "READY cut short": GREETING + bytes([4, len(CUT_SHORT)]) + CUT_SHORT,
    "another mechanism": GREETING.replace(b"NULL\0", b"PLAIN"),
    "a message before READY": GREETING + b"\x00\x05hello",
}
"""What libzmq ends a connection for, once and for all."""


def break_the_rules(listener: socket.socket, said: bytes) -> None:
    """Take one connection, say that, and wait until the other side has had enough."""
    with listener.accept()[0] as peer:
        peer.sendall(said)
        while peer.recv(4096):
            pass


def settings_at(first: int) -> BusSettings:
    return BusSettings.beginning_at(f"tcp://127.0.0.1:{first}")


@pytest.fixture
def ends() -> BusSettings:
    """Three ports that nobody listens at yet."""
    return settings_at(three_free_ports())


def listen(ends: BusSettings) -> list[socket.socket]:
    made = []
    for endpoint in (ends.ingress, ends.egress, ends.control):
        made.append(socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2]))))
        made[-1].settimeout(10.0)
    return made


@pytest.mark.parametrize("said", RUDE.values(), ids=RUDE)
def test_publisher_subscriber_and_requests_find_the_healthy_bus(
    run: Run, context: Context, ends: BusSettings, said: bytes
) -> None:
    async def scenario() -> None:
        listeners = listen(ends)
        with Bus.connect(ends, context) as bus:
            publisher, subscriber, control = bus.publisher("x"), bus.subscriber(["user/"]), bus.control()
            await asyncio.gather(*(asyncio.to_thread(break_the_rules, listener, said) for listener in listeners))
            for listener in listeners:
                listener.close()
            with Broker(ends, context):
                server = ControlServer(context, ends.control, {})
                serving = asyncio.ensure_future(server.run())
                await asyncio.gather(publisher.ready(20.0), subscriber.ready(20.0))
                assert set(await control.request("time", timeout_s=20.0)) == {"t"}
                publish(publisher, 5)
                assert [received.message.seq for received in await take(subscriber, 5)] == [0, 1, 2, 3, 4]
                server.close()
                await serving

    run(scenario())


def test_without_an_event_loop_as_well(context: Context, ends: BusSettings) -> None:
    listeners = listen(ends)
    with Bus.connect(ends, context) as bus:
        publisher, subscriber = bus.publisher("x"), bus.subscriber(["user/"])
        for listener in listeners[:2]:
            break_the_rules(listener, RUDE["READY cut short"])
        for listener in listeners:
            listener.close()
        with Broker(ends, context):
            publisher.wait_ready(20.0)
            subscriber.wait_ready(20.0)
            assert publisher._revival.revived == subscriber._revival.revived == 1


def test_without_revival_they_would_not(
    run: Run, context: Context, ends: BusSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test's own test: this is what libzmq does by itself."""
    monkeypatch.setattr(Revival, "check", lambda self: None)

    async def scenario() -> None:
        listeners = listen(ends)
        with Bus.connect(ends, context) as bus:
            subscriber = bus.subscriber(["user/"])
            await asyncio.to_thread(break_the_rules, listeners[1], RUDE["READY cut short"])
            for listener in listeners:
                listener.close()
            with Broker(ends, context), pytest.raises(TimeoutError):
                async with asyncio.timeout(1.5):
                    await subscriber.ready(20.0)

    run(scenario())


def test_a_relay_finds_the_service_that_let_it_in_later(
    run: Run, context: Context, tmp_path: Path, ends: BusSettings
) -> None:
    """Refused for its key, both ways and requests; then the service starts again with the key on its list."""
    keyring = Keyring(tmp_path / "keys", {})
    newcomer = new_keys(keyring.folder, "newcomer")
    strict = keyring.settings.curve.model_copy(update={"listen": ends.ingress})
    listed = CurveClient(name="newcomer", key=newcomer.public, roles=("publish", "subscribe", "control"))
    own = CurveSettings(secret=keyring.folder / "newcomer.key_secret", service=keyring.service)

    def service(curve: CurveSettings) -> Broker:
        return Broker(keyring.settings.model_copy(update={"curve": curve}), context)

    async def scenario() -> None:
        with service(strict) as broker, Relay(ends.model_copy(update={"curve": own}), keyring.settings) as relay:
            running = asyncio.ensure_future(relay.run())
            server = ControlServer(context, "tcp://127.0.0.1:0", {}, doorkeeper=broker.doorkeeper)
            assert broker.doorkeeper is not None
            while broker.doorkeeper.refused["key"] < 4:  # noqa: ASYNC110 - nothing says when
                await asyncio.sleep(0.01)
            server.close()
            broker.stop()
            with service(strict.model_copy(update={"clients": (listed,)})) as again:
                server = ControlServer(context, "tcp://127.0.0.1:0", {}, doorkeeper=again.doorkeeper)
                serving = asyncio.ensure_future(server.run())
                with Bus.connect(relay.endpoints, context) as behind:
                    publisher, subscriber = behind.publisher("x"), behind.subscriber(["user/"])
                    await asyncio.gather(publisher.ready(20.0), subscriber.ready(20.0))
                    publish(publisher, 5)
                    assert len(await take(subscriber, 5)) == 5
                    while not relay.clock.fresh():  # noqa: ASYNC110 - as above
                        await asyncio.sleep(0.01)
                server.close()
                await serving
                running.cancel()
                await asyncio.gather(running, return_exceptions=True)

    run(scenario())
