"""Whatever comes to the control socket gets an answer."""

from __future__ import annotations

import asyncio
import random
import socket as network
from collections.abc import Callable, Coroutine, Iterator
from typing import Annotated, Any

import msgpack
import pytest
import zmq
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import Field

from foottrack_protocol.messages import Health, Session
from foottrack_service.bus import ControlClient, ControlError, ControlServer, ControlTimeout, ManualClock
from foottrack_service.bus.control import MAX_WAITING, Handler
from foottrack_service.bus.endpoints import Context
from foottrack_service.bus.health import HealthBoard
from foottrack_service.bus.session import SessionInfo
from foottrack_service.bus.timesync import SyncedClock, synchronise

Run = Callable[..., Any]
LOCAL = "tcp://127.0.0.1:0"


class Service:
    """A control server with handlers of all kinds."""

    def __init__(self, context: Context) -> None:
        self.clock = ManualClock(4_711)
        self.board = HealthBoard()
        self.gate = asyncio.Event()
        self.waiting = 0
        self.names: list[str] = []
        handlers: dict[str, Handler] = {
            "record/start": self.record,
            "wait": self.wait,
            "refuse": self.refuse,
            "break": self.fail,
            "unpackable": lambda: {"x": object()},
            "later/break": self.fail_later,
            "misuse": self.misuse,
            "later/misuse": self.misuse_later,
        }
        session = SessionInfo(users=["user"], config_hash="abc", clock=self.clock)
        self.server = ControlServer(context, LOCAL, handlers, session=session, board=self.board, clock=self.clock)
        self.endpoint = self.server.endpoint

    def record(self, name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+$")], fast: bool = False) -> dict[str, Any]:
        self.names.append(name)
        return {"file": f"{name}.mcap", "fast": fast}

    async def wait(self, number: int) -> int:
        self.waiting += 1
        await self.gate.wait()
        return number

    def refuse(self) -> None:
        raise ControlError("not_available", "no camera is there")

    def fail(self) -> None:
        raise RuntimeError("broken inside")

    async def fail_later(self) -> None:
        await asyncio.sleep(0)
        raise RuntimeError("broken later")

    def misuse(self) -> None:
        Session.model_validate({"number": "none"})

    async def misuse_later(self) -> None:
        self.misuse()


@pytest.fixture
def service(context: Context) -> Iterator[Service]:
    made = Service(context)
    yield made
    made.server.close()


@pytest.fixture
def client(context: Context, service: Service) -> Iterator[ControlClient]:
    made = ControlClient(context, service.endpoint)
    yield made
    made.close()


async def serving(service: Service, scenario: Coroutine[Any, Any, Any]) -> Any:
    """A scenario beside the running server, which must outlive it."""
    server = asyncio.create_task(service.server.run())
    try:
        result = await scenario
        assert not server.done()
        return result
    finally:
        server.cancel()
        await asyncio.gather(server, return_exceptions=True)


async def until(condition: Callable[[], bool]) -> None:
    while not condition():  # noqa: ASYNC110 - what is waited for has no event of its own
        await asyncio.sleep(0)


async def failure(client: ControlClient, cmd: str, args: Any = None) -> tuple[str, str]:
    with pytest.raises(ControlError) as caught:
        await client.request(cmd, args)
    return caught.value.code, caught.value.message


def test_hello_time_and_status_are_built_in(run: Run, service: Service, client: ControlClient) -> None:
    async def scenario() -> None:
        hello = Session.model_validate(await client.request("hello"))
        assert (hello.users, hello.config_hash, hello.clock.bus) == (["user"], "abc", 4_711)
        assert hello.protocol.major == 1
        assert await client.request("time") == {"t": 4_711}
        service.board.node("imu-left", "restarting", "unplugged")
        status = Health.model_validate(await client.request("status"))
        assert status.nodes["imu-left"].error == "unplugged"

    run(serving(service, scenario()))


def test_arguments_are_checked_against_the_handler(run: Run, service: Service, client: ControlClient) -> None:
    async def scenario() -> None:
        assert await client.request("record/start", {"name": "walk-1"}) == {"file": "walk-1.mcap", "fast": False}
        for bad in ({}, {"name": 5}, {"name": "../../etc/passwd"}, {"name": "x", "fast": "yes"}, {"name": "x", "y": 1}):
            code, message = await failure(client, "record/start", bad)
            assert code == "bad_arguments"
            assert any(word in message for word in ("name", "fast", "y:"))
        assert (await failure(client, "hello", {"x": 1}))[0] == "bad_arguments"

    run(serving(service, scenario()))
    assert service.names == ["walk-1"]


def test_a_handler_that_waits_has_its_arguments_checked_as_well(
    run: Run, service: Service, client: ControlClient
) -> None:
    async def scenario() -> None:
        for bad, named in (({"number": "three"}, "number"), ({"numbr": 3}, "numbr"), ({}, "number")):
            code, message = await failure(client, "wait", bad)
            assert code == "bad_arguments"
            assert named in message
        await failure(client, "no/such")
        status = Health.model_validate(await client.request("status"))
        assert status.drops == {"control/bad_arguments": 3, "control/unknown_command": 1}
        # What goes wrong within a handler is not the request's fault.
        for cmd in ("misuse", "later/misuse"):
            code, message = await failure(client, cmd)
            assert code == "internal"
            assert message.startswith("ValidationError: ")

    run(serving(service, scenario()))
    assert service.waiting == 0


def test_failures_are_answered_and_do_not_end_the_server(run: Run, service: Service, client: ControlClient) -> None:
    async def scenario() -> None:
        assert await failure(client, "refuse") == ("not_available", "no camera is there")
        assert await failure(client, "break") == ("internal", "RuntimeError: broken inside")
        assert await failure(client, "later/break") == ("internal", "RuntimeError: broken later")
        assert (await failure(client, "unpackable"))[0] == "internal"
        code, message = await failure(client, "calibrate/flor")
        assert code == "unknown_command"
        assert "record/start" in message
        assert await client.request("time") == {"t": 4_711}

    run(serving(service, scenario()))


def test_a_handler_that_waits_does_not_hold_up_others(
    run: Run, service: Service, client: ControlClient, context: Context
) -> None:
    dealer = context.socket(zmq.DEALER)
    dealer.connect(service.endpoint)

    async def scenario() -> None:
        for number in range(MAX_WAITING):
            dealer.send(msgpack.packb({"cmd": "wait", "args": {"number": number}}))
        await until(lambda: service.waiting == MAX_WAITING)
        assert (await failure(client, "wait", {"number": 0}))[0] == "busy"
        service.gate.set()
        answers: list[int] = []
        while len(answers) < MAX_WAITING:
            await asyncio.sleep(0)
            while dealer.poll(0):
                answers.append(msgpack.unpackb(dealer.recv())["result"])
        assert sorted(answers) == list(range(MAX_WAITING))
        assert await client.request("wait", {"number": 3}) == 3

    run(serving(service, scenario()))
    dealer.close(0)


def test_an_answer_that_comes_too_late_is_not_taken_for_the_next(
    run: Run, service: Service, client: ControlClient
) -> None:
    async def scenario() -> None:
        with pytest.raises(ControlTimeout, match="'wait'"):
            await client.request("wait", {"number": 1}, timeout_s=0.05)
        service.gate.set()
        assert await client.request("wait", {"number": 2}) == 2

    run(serving(service, scenario()))


def test_nobody_there_is_said_in_words_and_the_command_is_not_obeyed_later(run: Run, context: Context) -> None:
    first = Service(context)
    client = ControlClient(context, first.endpoint)
    first.server.close()

    async def scenario() -> None:
        with pytest.raises(ControlTimeout, match="is the service running"):
            await client.request("record/start", {"name": "too-late"}, timeout_s=0.1)
        second = ControlServer(context, first.endpoint, {"record/start": first.record})
        server = asyncio.create_task(second.run())
        await client.request("record/start", {"name": "in-time"})
        second.close()
        await server

    run(scenario())
    client.close()
    assert first.names == ["in-time"]


def test_req_sockets_are_answered_too(run: Run, service: Service, context: Context) -> None:
    req = context.socket(zmq.REQ)
    req.connect(service.endpoint)

    async def scenario() -> Any:
        req.send(msgpack.packb({"cmd": "time"}))
        await until(lambda: req.poll(0) != 0)
        return msgpack.unpackb(req.recv())

    assert run(serving(service, scenario())) == {"ok": True, "result": {"t": 4_711}}
    req.close(0)


REQUESTS = st.one_of(
    st.binary(max_size=200),
    st.recursive(
        st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.text() | st.binary(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text() | st.integers(0, 9), inner),
        max_leaves=10,
    ).map(msgpack.packb),
    st.fixed_dictionaries(
        {"cmd": st.sampled_from(["hello", "time", "status", "record/start", "refuse", "break", "unpackable", 5])},
        optional={"args": st.none() | st.dictionaries(st.text(), st.integers(0, 5)) | st.lists(st.integers(0, 5))},
    ).map(msgpack.packb),
)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(REQUESTS, min_size=20, max_size=60))
def test_any_bytes_get_an_answer_each(run: Run, service: Service, context: Context, requests: list[bytes]) -> None:
    dealer = context.socket(zmq.DEALER)
    dealer.connect(service.endpoint)

    async def scenario() -> list[list[bytes]]:
        for number, request in enumerate(requests):
            dealer.send_multipart([b"%d" % number, b"", request])
        answers: list[list[bytes]] = []
        while len(answers) < len(requests):
            await asyncio.sleep(0)
            while dealer.poll(0):
                answers.append(dealer.recv_multipart())
        return answers

    answers = run(serving(service, scenario()))
    assert sorted(int(frames[0]) for frames in answers) == list(range(len(requests)))
    for frames in answers:
        answer = msgpack.unpackb(frames[-1])
        assert answer["ok"] is True or set(answer["error"]) == {"code", "message"}
    dealer.close(0)


def test_bytes_that_are_not_zeromq_do_not_disturb_it(run: Run, service: Service, client: ControlClient) -> None:
    source = random.Random(0)
    port = int(service.endpoint.rpartition(":")[2])

    async def scenario() -> None:
        for start in (b"GET / HTTP/1.1\r\n\r\n", b"\xff" + bytes(8) + b"\x7f\x03"):
            with network.create_connection(("127.0.0.1", port)) as connection:
                connection.sendall(start + source.randbytes(500))
        assert await client.request("time") == {"t": 4_711}

    run(serving(service, scenario()))


def test_a_party_with_a_clock_of_its_own_learns_the_bus_clock(
    run: Run, service: Service, client: ControlClient
) -> None:
    own = ManualClock(1_000)
    clock = SyncedClock(own)

    async def scenario() -> None:
        task = asyncio.create_task(synchronise(clock, client))
        await until(clock.fresh)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(serving(service, scenario()))
    assert clock.offset == 4_711 - 1_000
    assert clock() == 4_711


def test_a_service_that_is_away_only_lets_the_clock_go_stale(run: Run, context: Context) -> None:
    clock = SyncedClock()
    closed = Service(context)
    client = ControlClient(context, closed.endpoint)
    closed.server.close()

    async def scenario() -> None:
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.7):
                await synchronise(clock, client)

    run(scenario())
    assert not clock.fresh()
    client.close()
