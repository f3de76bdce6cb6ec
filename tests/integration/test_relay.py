"""The relay: everything goes through it unchanged, and nobody behind it believes in a service that is not there."""

from __future__ import annotations

import asyncio
import json
import logging
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from bus_traffic import BODY, publish, take
from curve_keys import EPHEMERAL, Keyring
from free_ports import three_free_ports
from typer.testing import CliRunner, Result

from foottrack_protocol import encode
from foottrack_service.bus import (
    BindRefused,
    Broker,
    Bus,
    ControlClient,
    ControlError,
    ControlServer,
    KeyFileError,
    NotReady,
    Publisher,
    Subscriber,
    now,
)
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.security import load_keys, new_keys
from foottrack_service.bus.timesync import SyncedClock, clock_of
from foottrack_service.cli.main import app
from foottrack_service.cli.running import CommandFailed
from foottrack_service.config import BusSettings, ConfigError, load
from foottrack_service.relay import Relay

Run = Callable[..., Any]
SOON_S = 0.4
APART = 5_000_000_000_000


def service_clock() -> int:
    """The clock of the service's host, which is another than the relay's."""
    return now() + APART


@pytest.fixture
def keyring(tmp_path: Path) -> Keyring:
    """One client, who may do everything."""
    return Keyring(tmp_path / "keys", {"engine": ("publish", "subscribe", "control")})


@asynccontextmanager
async def control(broker: Broker) -> AsyncIterator[ControlServer]:
    """The service's control socket."""
    server = ControlServer(
        broker.context,
        "tcp://127.0.0.1:0",
        {"add": lambda a: a + 1},  # type: ignore[misc]
        clock=service_clock,
        doorkeeper=broker.doorkeeper,
    )
    serving = asyncio.ensure_future(server.run())
    try:
        yield server
    finally:
        server.close()
        await serving


@asynccontextmanager
async def relaying(service: BusSettings) -> AsyncIterator[Relay]:
    """A relay that runs."""
    with Relay(service, EPHEMERAL) as relay:
        running = asyncio.ensure_future(relay.run())
        try:
            yield relay
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


async def both_found(publisher: Publisher, subscriber: Subscriber, times: int) -> None:
    """Wait until both found the bus so often."""
    while not publisher.live or publisher.connections < times:
        await publisher._watch.readable()
    while subscriber.connections < times:
        await subscriber._watch.readable()
        subscriber.drain()


async def clock_found(relay: Relay, client: ControlClient) -> None:
    """Wait until requests and answers pass, and the relay has the service's clock."""
    while not relay.clock.fresh():
        with suppress(ControlError):
            await client.request("hello")
    while True:
        with suppress(ControlError):
            await client.request("hello")
            return


def test_messages_pass_unchanged_in_both_directions(run: Run, keyring: Keyring, context: Context) -> None:
    async def scenario() -> None:
        with Broker(keyring.settings, context) as broker:
            async with relaying(keyring.client(broker, "engine")) as relay:
                with Bus.connect(relay.endpoints, context) as behind, Bus.connect(broker.inproc, context) as service:
                    for sender, receiver in ((behind, service), (service, behind)):
                        publisher, subscriber = sender.publisher("someone"), receiver.subscriber(["user/"])
                        await publisher.ready()
                        await subscriber.ready()
                        sent = [encode(publisher.publish("user", "truth/left", n, BODY)) for n in range(50)]
                        assert [received.raw for received in await take(subscriber, 50)] == sent

    run(scenario())


def test_requests_pass_and_time_is_the_services(run: Run, keyring: Keyring, context: Context) -> None:
    async def scenario() -> None:
        with Broker(keyring.settings, context) as broker:
            async with control(broker), relaying(keyring.client(broker, "engine")) as relay:
                with Bus.connect(relay.endpoints, context) as behind:
                    client = behind.control()
                    await clock_found(relay, client)
                    assert await client.request("add", {"a": 1}) == 2
                    with pytest.raises(ControlError, match="unknown_command"):
                        await client.request("dance")
                    before = service_clock()
                    told = (await client.request("time"))["t"]
                    after = service_clock()
                    unsure = relay.clock.uncertainty
                    assert unsure is not None
                    assert before - unsure <= told <= after + unsure

    run(scenario())


def test_a_party_knows_whether_the_services_clock_is_its_own(run: Run, keyring: Keyring, context: Context) -> None:
    async def scenario() -> None:
        with Broker(keyring.settings, context) as broker:
            async with control(broker), relaying(keyring.client(broker, "engine")) as relay:
                with Bus.connect(relay.endpoints, context) as behind:
                    client = behind.control()
                    await clock_found(relay, client)
                    clock = await clock_of(client)
                    assert isinstance(clock, SyncedClock)
                    assert clock.fresh()
                    unsure = (relay.clock.uncertainty or 0) + (clock.uncertainty or 0)
                    before, told, after = service_clock(), clock(), service_clock()
                    assert before - unsure <= told <= after + unsure
        server = ControlServer(context, "tcp://127.0.0.1:0", {})
        serving = asyncio.ensure_future(server.run())
        with Bus.connect(BusSettings(control=server.endpoint), context) as beside:
            assert await clock_of(beside.control()) is now
        server.close()
        await serving

    run(scenario())


def test_without_the_service_nothing_is_promised(run: Run, keyring: Keyring, context: Context) -> None:
    async def scenario() -> None:
        with Broker(keyring.settings, context) as broker:
            service = keyring.client(broker, "engine")
        async with relaying(service) as relay:
            with Bus.connect(relay.endpoints, context) as behind:
                publisher, subscriber, client = behind.publisher("x"), behind.subscriber(), behind.control()
                for each in (publisher, subscriber):
                    with pytest.raises(NotReady, match="no bus answers behind it"):
                        await each.ready(SOON_S)
                for command in ("time", "hello"):
                    with pytest.raises(ControlError, match=r"relay.*unavailable"):
                        await client.request(command)

    run(scenario())


def test_a_service_that_restarts_is_found_again(run: Run, keyring: Keyring, context: Context) -> None:
    async def scenario() -> None:
        curve = keyring.settings.curve.model_copy(update={"listen": f"tcp://127.0.0.1:{three_free_ports()}"})
        settings = keyring.settings.model_copy(update={"curve": curve})
        with Broker(settings, context) as broker:
            service = keyring.client(broker, "engine")
        async with relaying(service) as relay:
            with Bus.connect(relay.endpoints, context) as behind:
                publisher, subscriber = behind.publisher("x"), behind.subscriber(["user/"])
                for times in (1, 2):
                    with Broker(settings, context):
                        await both_found(publisher, subscriber, times)
                        publish(publisher, 3)
                        received = await take(subscriber, 3)
                        assert [one.message.seq for one in received] == [3 * times - 3, 3 * times - 2, 3 * times - 1]
                    while publisher.live:
                        await publisher._watch.readable()

    run(scenario())


def test_a_wrong_key_is_told_by_the_relay(
    run: Run, keyring: Keyring, context: Context, caplog: pytest.LogCaptureFixture
) -> None:
    new_keys(keyring.folder, "stranger")

    async def scenario() -> None:
        with Broker(keyring.settings, context) as broker:
            async with control(broker), relaying(keyring.client(broker, "stranger")):
                while "does not let the key" not in caplog.text:  # noqa: ASYNC110 - nothing says when
                    await asyncio.sleep(0.01)

    with caplog.at_level(logging.WARNING):
        run(scenario())


def test_a_relay_opens_nothing_to_the_network(keyring: Keyring) -> None:
    with pytest.raises(BindRefused), Relay(keyring.settings, BusSettings(ingress="tcp://0.0.0.0:0")):
        pass


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """``foottrack`` in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(app, arguments)


def test_keys_new_writes_what_the_settings_need_and_overwrites_nothing(
    command: Callable[..., Result], tmp_path: Path
) -> None:
    service, client = command("keys", "new").stdout.split("\n\n")
    for name, text in (("service.toml", service), ("client.toml", client)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    at_service = load(tmp_path / "service.toml").settings.bus.curve
    at_client = load(tmp_path / "client.toml").settings.bus.curve
    assert at_service.secret is not None
    assert load_keys(at_service.secret).public == at_client.service
    assert at_client.secret is not None
    assert [load_keys(at_client.secret).public] == [entry.key for entry in at_service.clients]
    again = command("keys", "new")
    assert isinstance(again.exception, KeyFileError)
    assert "not overwritten" in str(again.exception)


def test_keys_new_as_json_has_no_secrets(command: Callable[..., Result], tmp_path: Path) -> None:
    made = json.loads(command("keys", "new", "headset", "--json").stdout)
    secret = (tmp_path / "keys" / "headset.key_secret").read_text(encoding="utf-8")
    assert made["headset"]["public"] in secret
    assert secret.split('"')[3] not in json.dumps(made)


@pytest.mark.parametrize("name", ["../x", "a/b", "", ".."])
def test_keys_stay_in_their_folder(command: Callable[..., Result], name: str, tmp_path: Path) -> None:
    assert isinstance(command("keys", "new", name).exception, CommandFailed)
    assert not list(tmp_path.iterdir())


def test_a_relay_without_keys_says_how_to_make_them(command: Callable[..., Result]) -> None:
    refused = command("relay", "tcp://127.0.0.1:7711").exception
    assert isinstance(refused, CommandFailed)
    assert "foottrack keys new" in str(refused)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no file modes")
def test_secret_keys_are_the_owners_alone(tmp_path: Path) -> None:
    new_keys(tmp_path, "someone")
    file = tmp_path / "someone.key_secret"
    assert file.stat().st_mode & 0o777 == 0o600
    file.chmod(0o640)
    with pytest.raises(KeyFileError, match="chmod 600"):
        load_keys(file)


@pytest.mark.parametrize(("content", "told"), [("", "keys new"), ('curve\n    public-key = "x"\n', "key_secret")])
def test_unfit_key_files_are_told(tmp_path: Path, content: str, told: str) -> None:
    file = tmp_path / "x.key_secret"
    file.write_text(content, encoding="utf-8")
    file.chmod(0o600)
    with pytest.raises(KeyFileError, match=told):
        load_keys(file)
    with pytest.raises(KeyFileError, match="keys new"):
        load_keys(tmp_path / "missing")


@pytest.mark.parametrize("key", ["listen", "service"])
def test_settings_without_a_key_are_refused(tmp_path: Path, key: str) -> None:
    file = tmp_path / "foottrack.toml"
    value = "tcp://0.0.0.0:7711" if key == "listen" else "a" * 40
    file.write_text(f'[bus.curve]\n{key} = "{value}"\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="needs secret"):
        load(file)
