"""What a game in Godot asks the service: answered, refused with the reason, or given up in time."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest
from client_traffic import ports
from fake_service import MORE, FakeService, message
from godot_project import GodotProject
from live_service import LiveService

from foottrack_client import Client, Endpoints

pytestmark = pytest.mark.engine


def settings_of(endpoints: Endpoints, *requests: tuple[str, dict[str, Any], float], **more: Any) -> dict[str, Any]:
    return {**ports(endpoints), "requests": requests, **more}


def answers(godot: GodotProject, settings: dict[str, Any]) -> list[dict[str, Any]]:
    with godot.start("requests.gd", settings) as run:
        said: list[dict[str, Any]] = run.until("answers")["answers"]
    return said


def test_requests_under_way_at_once_get_each_its_answer(godot: GodotProject, service: LiveService) -> None:
    asked = [
        ("hello", {}, 20.0),
        ("fly", {}, 20.0),
        ("calibrate/body", {"height": 9.0}, 20.0),
        ("record/stop", {}, 20.0),
    ]
    hello, *failed = answers(godot, settings_of(service.endpoints, *asked))
    with Client(service.endpoints) as client:
        assert hello["ok"], hello
        assert hello["result"]["session"] == client.hello().session
    assert [answer["error"]["code"] for answer in failed] == ["unknown_command", "bad_arguments", "not_running"]
    assert all(not answer["ok"] and answer["error"]["message"] for answer in failed)


def test_a_service_that_is_not_there_is_given_up_in_time(godot: GodotProject) -> None:
    nobody = Endpoints.beginning_at("tcp://127.0.0.1:1")
    (answer,) = answers(godot, settings_of(nobody, ("hello", {}, 0.3)))
    assert answer["error"]["code"] == "timeout"
    assert "is the service running" in answer["error"]["message"]


def test_a_client_that_leaves_leaves_nobody_waiting(godot: GodotProject, service: LiveService) -> None:
    asked = settings_of(service.endpoints, ("calibrate/floor", {}, 60.0), leave=True)
    (answer,) = answers(godot, asked)
    assert answer["error"] == {"code": "timeout", "message": "the client left the scene"}


@pytest.mark.parametrize(
    "answer",
    [b"", b"\xc1", b"\x80", msgpack.packb({"ok": True, "result": {"t": float("nan")}}), msgpack.packb({"ok": False})],
    ids=["nothing", "no msgpack", "no answer", "NaN", "no error"],
)
def test_an_answer_that_is_none_is_told(godot: GodotProject, fake: FakeService, answer: bytes) -> None:
    asked = settings_of(fake.endpoints, ("hello", {}, 20.0))
    with godot.start("requests.gd", asked) as run:
        # The first connection keeps the time, the second one asks.
        fake.control()
        peer = fake.control()
        peer.shake_hands(b"ROUTER")
        flags, number = peer.read_frame()
        assert flags == MORE and peer.read_frame() == (MORE, b"")
        assert msgpack.unpackb(peer.read_frame()[1]) == {"cmd": "hello", "args": {}}
        # To another request than was asked: nobody's.
        peer.send(message(b"99", b"", msgpack.packb({"ok": True, "result": {}})))
        peer.send(message(number, b"", answer))
        (told,) = run.until("answers")["answers"]
    assert told["error"]["code"] == "bad_answer"


def test_a_client_in_no_scene_can_still_be_asked(godot: GodotProject) -> None:
    for said in godot.run("outside.gd").values():
        assert 1.0 <= said.pop("age") < 2.0
        assert said == {"synchronised": False, "connected": False, "bus_time": True, "statistics": {}}
