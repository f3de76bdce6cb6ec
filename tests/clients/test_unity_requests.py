"""What a game in Unity asks the service: answered, refused with the reason, or given up in time."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest
from fake_service import MORE, FakeService, message
from live_service import LiveService
from unity_mono import UnityPackage

from foottrack_client import Client, Endpoints

pytestmark = pytest.mark.engine


def answers(unity: UnityPackage, endpoints: Endpoints, timeout_ms: int, *asked: str) -> list[dict[str, Any]]:
    with unity.requests(endpoints, timeout_ms, *asked) as run:
        said: list[dict[str, Any]] = run.until("answers")["answers"]
    return said


def test_requests_under_way_at_once_get_each_its_answer(unity: UnityPackage, service: LiveService) -> None:
    asked = ("hello", "fly", "calibrate/body?height=9.5", "record/stop", "status")
    hello, *failed, status = answers(unity, service.endpoints, 20_000, *asked)
    with Client(service.endpoints) as client:
        due = client.hello()
    assert hello["ok"] and hello["result"]["session"] == due.session
    assert hello["result"]["protocol"] == due.protocol.model_dump()
    assert hello["result"]["users"] == due.users
    assert isinstance(status["result"]["topics"], dict)
    assert [answer["code"] for answer in failed] == ["unknown_command", "bad_arguments", "not_running"]
    assert all(not answer["ok"] and answer["message"] and answer["result"] is None for answer in failed)


def test_a_service_that_is_not_there_is_given_up_in_time(unity: UnityPackage) -> None:
    (answer,) = answers(unity, Endpoints.beginning_at("tcp://127.0.0.1:1"), 300, "hello")
    assert (answer["ok"], answer["code"]) == (False, "timeout")
    assert "is the service running" in answer["message"]


def test_a_game_that_leaves_ends_at_once(unity: UnityPackage, service: LiveService) -> None:
    (answer,) = answers(unity, service.endpoints, 100, "calibrate/floor", "leave")
    assert not answer["ok"]


@pytest.mark.parametrize(
    "answer",
    [b"", b"\xc1", b"\x80", msgpack.packb({"ok": True, "result": {"t": float("nan")}}), msgpack.packb({"ok": False})],
    ids=["nothing", "no msgpack", "no answer", "NaN", "no error"],
)
def test_an_answer_that_is_none_is_told(unity: UnityPackage, fake: FakeService, answer: bytes) -> None:
    with unity.requests(fake.endpoints, 20_000, "hello") as run:
        # One connection keeps the time, the other one asks; which is first is chance.
        for peer in (fake.control(), fake.control()):
            if peer.shake_hands(b"ROUTER") == b"DEALER":
                break
        flags, number = peer.read_frame()
        assert flags == MORE and peer.read_frame() == (MORE, b"")
        assert msgpack.unpackb(peer.read_frame()[1]) == {"cmd": "hello", "args": {}}
        # To another request than was asked: nobody's.
        peer.send(message(b"99", b"", msgpack.packb({"ok": True, "result": {}})))
        peer.send(message(number, b"", answer))
        (told,) = run.until("answers")["answers"]
    assert told["code"] == "bad_answer"
