"""foottrack_client against the running service and against a server that lies, blocking and async."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zmq
from client_traffic import FINAL, POSE, frames, step
from fake_service import COMMAND, FakeService, frame, message, rude_greetings
from live_service import LiveService

from foottrack_client import AsyncClient, Client, Endpoints, NoAnswer, NotReady, RequestFailed
from foottrack_client.clock import Clock, Exchange
from foottrack_client.receiver import MAX_TOPICS, Receiver
from foottrack_protocol.golden.valid import message_as_json
from foottrack_protocol.messages import Health, Session
from foottrack_service.bus.timesync import Exchange as PeersExchange
from foottrack_service.bus.timesync import SyncedClock

VECTORS = Path(__file__).parents[2] / "protocol/vectors"
EXAMPLES = Path(__file__).parents[2] / "clients/python/examples"
Run = Callable[..., Any]
NOBODY = Endpoints.beginning_at("tcp://127.0.0.1:1")


def receiver() -> Receiver:
    return Receiver(Clock(), lambda _: None, lambda _: None)


def test_every_golden_vector_is_understood_or_counted_under_its_reason() -> None:
    for path in VECTORS.glob("*.json"):
        for vector in json.loads(path.read_text(encoding="utf-8"))["vectors"]:
            took = receiver()
            if path.name == "invalid.json":
                parts = [bytes.fromhex(part) for part in vector["frames_hex"]]
                if parts:
                    parts[-1] += bytes(vector.get("last_frame_zeros", 0))
                assert took.take(parts) is None
                topics = took.statistics.topics.values()
                reasons = took.statistics.drops + sum((topic.drops for topic in topics), took.statistics.drops.copy())
                assert set(reasons) == {vector["reason"]}, vector["name"]
            else:
                payload = bytes.fromhex(vector["payload_hex"]) + bytes(vector.get("payload_zeros", 0))
                understood = took.take([bytes.fromhex(vector["topic_hex"]), payload])
                assert understood is not None and message_as_json(understood) == vector["message"]


def test_gaps_repeats_and_new_runs_are_told_apart() -> None:
    took = receiver()
    for seq, sid in [(3, "a"), (4, "a"), (7, "a"), (7, "a"), (8, "a"), (0, "b"), (2, "b")]:
        took.take(frames("gait/event", step(0), seq, sid=sid))
    counted = took.statistics.topics["user/gait/event"]
    assert (counted.messages, counted.gaps) == (7, 3)


def test_made_up_users_do_not_fill_the_memory() -> None:
    took = receiver()
    for number in range(MAX_TOPICS + 50):
        assert took.take(frames("gait/event", step(0), user=f"u{number}")) is not None
    assert len(took.statistics.topics) == MAX_TOPICS


def test_the_clock_is_the_service_s_own_method() -> None:
    own = 0
    ours, peer = Clock(same_host=False, own=lambda: own), SyncedClock(lambda: own)
    assert (ours.offset, ours.uncertainty, ours.is_fresh) == (None, None, False)
    for number, trip in enumerate([5_000_000, 80_000, 300_000, 200_000_000, 80_000, 100_000]):
        offset = 10**15 + (10**12 if number == 5 else 0)
        ours.on_burst([Exchange(own, own + offset + trip // 3, own + trip)])
        peer.on_burst([PeersExchange(own, own + offset + trip // 3, own + trip)])
        own += trip + 2 * 10**9
        assert (ours.offset, ours.uncertainty, ours()) == (peer.offset, peer.uncertainty, peer())
        assert ours.is_fresh is peer.fresh() is True
    own += 9 * 10**9
    assert ours.is_fresh is peer.fresh() is False
    ours.forget()
    assert ours.offset is None


def test_blocking_everything_there_and_back(service: LiveService) -> None:
    with Client(service.endpoints) as client:
        everything, poses = client.subscribe(), client.subscribe("pose/body", "sys/session")
        publisher = client.publisher("test")
        for ready in (everything, poses, publisher):
            ready.wait_ready()
        for number in range(1000):
            assert publisher.publish("gait/event", step(number))
            assert publisher.publish("pose/body", POSE)
        received = [everything.receive(5.0) for _ in range(2000)]
        assert [item.data.step for item in received if item is not None and item.stream == "gait/event"] == list(
            range(1000)
        )
        assert everything.receive(0.0) is None
        newest = []
        while not newest or newest[-1].seq != 999:
            newest = [item for item in poses.drain() if item.stream == "pose/body"] or newest
        assert len(newest) == 1
        assert all(topic.gaps == 0 for topic in everything.statistics.topics.values())
        assert publisher.sent == 2000
        assert isinstance(client.hello(), Session)
        assert isinstance(client.request("status"), Health)
        with pytest.raises(RequestFailed) as caught:
            client.request("fly")
        assert caught.value.code == "unknown_command"


def test_a_party_on_another_host_is_valid_once_it_knows_the_clock(service: LiveService) -> None:
    with Client(service.endpoints, same_host=False) as client, client.subscribe() as all_of_it:
        publisher = client.publisher("elsewhere")
        publisher.wait_ready()
        all_of_it.wait_ready()
        publisher.publish("gait/event", step(1))
        assert client.synchronise()
        publisher.publish("gait/event", step(2))
        before, after = (all_of_it.receive(5.0) for _ in range(2))
        assert before is not None and after is not None
        assert (before.valid, after.valid) == (False, True)
        # One host, one clock: the offset is 0 within what it says of itself.
        assert client.clock.offset is not None and client.clock.uncertainty is not None
        assert abs(client.clock.offset) <= client.clock.uncertainty


def test_async_everything_there_and_back(run: Run, service: LiveService) -> None:
    async def scenario() -> None:
        with AsyncClient(service.endpoints, same_host=False) as client:
            subscription = client.subscribe("gait/", "pose/")
            await subscription.ready()
            publisher = await client.publisher("test")
            assert await client.synchronise()
            for number in range(200):
                publisher.publish("gait/event", step(number))
                publisher.publish("pose/body", POSE)
            publisher.publish("gait/event", FINAL)
            steps = []
            async for item in subscription:
                assert item.valid
                if item.stream == "gait/event":
                    if item.data == FINAL:
                        break
                    steps.append(item.data.step)
            assert steps == list(range(200))
            assert isinstance(await client.hello(), Session)
            with pytest.raises(RequestFailed):
                await client.request("calibrate/floor", user="not a user")
            assert await subscription.drain() == []

    run(scenario())


def test_a_restarted_service_is_found_again_and_the_loss_is_exact(service: LiveService) -> None:
    with Client(service.endpoints) as client, client.subscribe("gait/") as subscription:
        publisher = client.publisher("test")
        seqs: list[int] = []
        number = 0
        for restarts in range(3):
            publisher.wait_ready()
            while subscription.statistics.connections <= restarts:
                assert subscription.receive(0.05) is None
            for _ in range(20):
                assert publisher.publish("gait/event", step(number))
                number += 1
            for _ in range(20):
                received = subscription.receive(5.0)
                assert received is not None
                seqs.append(received.seq)
            if restarts == 2:
                break
            service.stop()
            while publisher.live:
                pass
            for _ in range(5):
                assert not publisher.publish("gait/event", step(number))
                number += 1
            service.start()
        assert seqs == [*range(20), *range(25, 45), *range(50, 70)]
        assert subscription.statistics.topics["user/gait/event"].gaps == 10
        assert publisher.drops == {"no_bus": 10}


def test_a_server_that_lies_is_survived(fake: FakeService) -> None:
    with Client(fake.endpoints) as client, client.subscribe("gait/") as subscription:
        rude = rude_greetings()
        waiting = threading.Thread(target=subscription.wait_ready, args=(20.0,))
        waiting.start()
        for name in ("another protocol", "a frame of 1 GiB", "the wrong socket", "READY cut short"):
            peer = fake.egress()
            rude[name](peer, b"XPUB")
            peer.close()
        peer = fake.egress()
        assert peer.welcome() == {b"sys/welcome", b"user/gait/"}
        waiting.join()
        good = frames("gait/event", step(5))
        envelope = msgpack.unpackb(good[1])
        peer.send(message(b"user/gait/event"))
        peer.send(message(good[0], good[1][:-1]))
        peer.send(message(good[0], bytes(300_000)))
        peer.send(message(good[0], msgpack.packb({**envelope, "v": 2})))
        peer.send(frame(b"\x07NOTHING", COMMAND))
        whole = message(*good)
        peer.send(whole[:30])
        # Half a message holds nobody up, and comes whole when its rest is there.
        assert subscription.receive(0.05) is None
        peer.send(whole[30:])
        received = subscription.receive(5.0)
        assert received is not None and received.data.step == 5
        counted = subscription.statistics
        assert counted.drops == {"frames": 1}
        assert counted.topics["user/gait/event"].messages == 1
        assert counted.topics["user/gait/event"].drops == {"msgpack": 1, "oversized": 1, "version": 1}


def test_libzmq_s_zombies_are_revived(run: Run, fake: FakeService) -> None:
    rude = rude_greetings()["READY cut short"]

    def lie_then_serve() -> None:
        for accept, socket_type in ((fake.egress, b"XPUB"), (fake.ingress, b"XSUB")):
            peer = accept()
            rude(peer, socket_type)
            peer.close()
        fake.live_egress()
        peer = fake.ingress()
        peer.shake_hands(b"XSUB")
        peer.send(message(b"\x01"))

    async def scenario() -> None:
        with AsyncClient(fake.endpoints) as client:
            subscription = client.subscribe()
            publisher = asyncio.ensure_future(client.publisher("test", 10.0))
            await subscription.ready(10.0)
            assert (await publisher).publish("gait/event", step(1))

    server = threading.Thread(target=lie_then_serve)
    server.start()
    run(scenario())
    server.join()


def test_nonsense_from_the_control_socket_is_an_error_in_words(fake: FakeService) -> None:
    errors: list[RequestFailed] = []

    def ask(client: Client) -> None:
        try:
            client.request("hello", timeout_s=5.0)
        except RequestFailed as error:
            errors.append(error)

    for answer in (b"\xc1", msgpack.packb({"ok": True, "result": {}}), msgpack.packb({"ok": 1}), b""):
        with Client(fake.endpoints) as client:
            asking = threading.Thread(target=ask, args=(client,))
            asking.start()
            peer = fake.control()
            peer.shake_hands(b"ROUTER")
            peer.read_frame()
            peer.read_frame()
            peer.send(message(b"", answer))
            asking.join()
    assert [error.code for error in errors] == ["bad_answer"] * 4


def test_a_service_that_is_not_there_is_told_in_words(run: Run) -> None:
    with Client(NOBODY) as client:
        with pytest.raises(NotReady, match="is the service running"), client.subscribe() as subscription:
            subscription.wait_ready(0.05)
        with pytest.raises(NotReady, match="is the service running"), client.publisher("x") as publisher:
            publisher.wait_ready(0.05)
        with pytest.raises(NoAnswer, match="hello"):
            client.request("hello", 0.05)
        assert not Client(NOBODY, same_host=False, context=client._context).synchronise()

    async def scenario() -> None:
        with AsyncClient(NOBODY) as client:
            with pytest.raises(NotReady):
                await client.publisher("x", 0.05)
            with pytest.raises(NotReady):
                await client.subscribe().ready(0.05)
            with pytest.raises(NoAnswer):
                await client.request("hello", 0.05)

    run(scenario())


def test_who_tries_again_and_again_does_not_run_out_of_sockets(run: Run) -> None:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    context.max_sockets = 12

    async def scenario() -> None:
        with AsyncClient(NOBODY, context=context) as client:
            for _ in range(30):
                with pytest.raises(NotReady):
                    await client.publisher("x", 0.01)

    run(scenario())
    context.term()


@pytest.mark.parametrize("first", ["7701", "tcp://127.0.0.1", "tcp://127.0.0.1:65534", "ipc://x:1"])
def test_an_endpoint_without_a_port_is_refused(first: str) -> None:
    with pytest.raises(ValueError, match="port"):
        Endpoints.beginning_at(first)


@pytest.mark.parametrize(
    ("example", "due"),
    [
        ("print_feet.py", "left   -0.100  0.090"),
        ("plot_heights.py", " 0.090 m #####"),
        ("send_head_pose.py", "head/pose"),
    ],
)
def test_the_examples_run(service: LiveService, example: str, due: str) -> None:
    # An example speaks to the default ports; here it gets those of the test's service.
    program = (
        "import sys, runpy; from foottrack_client import AsyncClient, Client, Endpoints; "
        "Client.__init__.__defaults__ = AsyncClient.__init__.__defaults__ = (Endpoints(*sys.argv[2:5]),); "
        "runpy.run_path(sys.argv[1])"
    )
    command = [sys.executable, "-u", "-c", program, str(EXAMPLES / example), *service.endpoints]
    with Client(service.endpoints) as client, client.subscribe("head/pose") as heads:
        publisher = client.publisher("test")
        publisher.wait_ready()
        heads.wait_ready()
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        assert process.stdout is not None
        # Silence ends as a failure, not as a test that hangs.
        patience = threading.Timer(20.0, process.kill)
        patience.start()
        try:
            if example == "send_head_pose.py":
                head = heads.receive(20.0)
                assert head is not None and due in head.topic and head.valid
                return
            stop = threading.Event()

            def walk() -> None:
                while not stop.wait(0.005):
                    publisher.publish("pose/body", POSE)

            walking = threading.Thread(target=walk)
            walking.start()
            said = process.stdout.read(100).decode()
            stop.set()
            walking.join()
            assert due in said, said
        finally:
            patience.cancel()
            process.kill()
            process.wait()
            process.stdout.close()
