"""The Python client through CURVE: all there and back with the right keys, and why not with others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from client_traffic import step
from curve_keys import Keyring
from live_service import LiveService

from foottrack_client import AsyncClient, Client, Endpoints, KeyFileError, Keys, NoAnswer, NotReady
from foottrack_protocol.messages import Session
from foottrack_service.bus.security import new_keys

Run = Callable[..., Any]
SOON_S = 1.0


@pytest.fixture
def keyring(tmp_path: Path) -> Keyring:
    """One client who may do everything, and one who may only look."""
    roles = {"engine": ("publish", "subscribe", "control"), "screen": ("subscribe",)}
    return Keyring(tmp_path / "keys", roles)  # type: ignore[arg-type]


@pytest.fixture
def service(keyring: Keyring) -> Iterator[LiveService]:
    with LiveService(keyring.settings.curve) as made:
        yield made


def keys_of(keyring: Keyring, name: str, service: str | None = None) -> Keys:
    return Keys.load(keyring.folder / f"{name}.key_secret", service or keyring.service)


def test_blocking_there_and_back(service: LiveService, keyring: Keyring) -> None:
    keys = keys_of(keyring, "engine")
    with Client(service.encrypted, same_host=False, keys=keys) as client, client.subscribe("gait/") as events:
        publisher = client.publisher("test")
        publisher.wait_ready()
        events.wait_ready()
        assert client.synchronise()
        for number in range(100):
            assert publisher.publish("gait/event", step(number))
        received = [events.receive(5.0) for _ in range(100)]
        assert [each.data.step for each in received if each is not None and each.valid] == list(range(100))
        assert isinstance(client.hello(), Session)


def test_async_there_and_back(run: Run, service: LiveService, keyring: Keyring) -> None:
    async def scenario() -> None:
        with AsyncClient(service.encrypted, keys=keys_of(keyring, "engine")) as client:
            events = client.subscribe("gait/")
            await events.ready()
            (await client.publisher("test")).publish("gait/event", step(7))
            assert (await events.receive()).data.step == 7
            assert isinstance(await client.hello(), Session)

    run(scenario())


@pytest.mark.parametrize(
    ("who", "told"),
    [
        ("stranger", "does not know our key"),
        ("another service", "another key"),
        ("no keys", "encrypted connections only"),
    ],
)
def test_who_is_not_let_in_is_told_why(service: LiveService, keyring: Keyring, who: str, told: str) -> None:
    keys = None
    if who == "stranger":
        new_keys(keyring.folder, who)
        keys = keys_of(keyring, who)
    elif who == "another service":
        keys = keys_of(keyring, "engine", new_keys(keyring.folder, "other").public)
    with Client(service.encrypted, keys=keys) as client:
        with pytest.raises(NotReady, match=told):
            client.subscribe().wait_ready(SOON_S)
        with pytest.raises(NotReady, match=told):
            client.publisher("x").wait_ready(SOON_S)
        with pytest.raises(NoAnswer):
            client.request("hello", 0.2)


def test_who_may_look_may_not_publish(service: LiveService, keyring: Keyring) -> None:
    with Client(service.encrypted, keys=keys_of(keyring, "screen")) as client:
        client.subscribe().wait_ready()
        with pytest.raises(NotReady, match="not for this role"):
            client.publisher("x").wait_ready(SOON_S)


def test_keys_at_a_plain_port_are_told(service: LiveService, keyring: Keyring) -> None:
    with (
        Client(service.endpoints, keys=keys_of(keyring, "engine")) as client,
        pytest.raises(NotReady, match="does not speak CURVE"),
    ):
        client.subscribe().wait_ready(SOON_S)


def test_key_files_that_are_none_are_told(tmp_path: Path, keyring: Keyring) -> None:
    with pytest.raises(KeyFileError, match="keys new"):
        Keys.load(tmp_path / "missing", keyring.service)
    with pytest.raises(KeyFileError, match="key_secret"):
        Keys.load(keyring.folder / "engine.key", keyring.service)
    keys = keys_of(keyring, "engine")
    assert keys.secret not in repr(keys)
    assert Endpoints.beginning_at("tcp://127.0.0.1:7711").control.endswith(":7713")
