"""The Unity package against a server that lies: it stays alive, counts, and its main thread never waits."""

from __future__ import annotations

import itertools

import msgpack
import pytest
from client_traffic import FINAL, POSE, frames, step
from fake_service import COMMAND, MORE, FakeService, frame, message, rude_greetings
from test_godot_hostile import mutations, refused
from unity_mono import UnityPackage

from foottrack_protocol import decode
from foottrack_service.bus.session import SessionInfo

pytestmark = pytest.mark.engine


def test_garbage_is_counted_and_the_next_good_message_is_taken(unity: UnityPackage, fake: FakeService) -> None:
    fuzzed = mutations(3000)
    with unity.play(fake.endpoints) as run:
        peer = fake.live_egress()
        run.until("connected")
        for item in fuzzed:
            peer.send(message(*item))
        peer.send(message(b"one frame"))
        peer.send(message(*[b"many"] * 2000))
        peer.send(message(b"user/pose/body", bytes(1_000_000)))
        peer.send(message(b"x" * 1_000_000, b"\x80"))
        peer.send(frame(b"\x07NOTHING" + bytes(50), COMMAND))
        peer.send(frame(b"\x07NOTHING" + bytes(50_000), COMMAND))
        peer.send(message(*frames("gait/event", step(2))) + message(*frames("gait/event", FINAL)))
        said = run.until("final")
    assert said["steps"][-1] == 2
    statistics = said["statistics"]
    counted = statistics["topics"]["user/gait/event"]
    due = refused(fuzzed)
    assert sum(counted["refused"].values()) == sum(due.values()) > 1000
    assert counted["messages"] == len(fuzzed) - sum(due.values()) + 2
    assert statistics["topics"]["user/pose/body"]["refused"] == {"oversized": 1}
    assert statistics["unread"]["refused"] == {"frames": 2, "topic": 1}
    assert statistics["failures"] == statistics["violations"] == 0


def test_a_producer_that_makes_up_names_does_not_fill_the_memory(unity: UnityPackage, fake: FakeService) -> None:
    with unity.play(fake.endpoints) as run:
        peer = fake.live_egress()
        run.until("connected")
        for number in range(6000):
            peer.send(message(*frames("gait/event", step(number), user=f"u{number}", src=f"s{number}", sid="x" * 50)))
        peer.send(message(*frames("gait/event", FINAL)))
        said = run.until("final")
    assert len(said["steps"]) + said["statistics"]["overflow"] == 6000
    assert 1000 < len(said["statistics"]["topics"]) <= 1024


def test_another_major_is_told_in_words(unity: UnityPackage, fake: FakeService) -> None:
    topic, payload = frames("pose/body", POSE)
    envelope = msgpack.unpackb(payload)
    with unity.play(fake.endpoints) as run:
        peer = fake.live_egress()
        run.until("connected")
        peer.send(message(topic, msgpack.packb({**envelope, "v": 2})))
        report = run.until("refused")["report"]
    assert report["reason"] == "version"
    assert report["text"].startswith("protocol 2 on user/pose/body, this package speaks 1")


def test_a_server_that_breaks_the_rules_is_left_and_asked_again(unity: UnityPackage, fake: FakeService) -> None:
    rude = rude_greetings()
    with unity.play(fake.endpoints) as run:
        # Round the three sockets, since each waits for itself.
        sockets = itertools.cycle([(fake.egress, b"XPUB"), (fake.ingress, b"XSUB"), (fake.control, b"ROUTER")])
        for act, (accept, socket_type) in zip(rude.values(), sockets, strict=False):
            peer = accept()
            act(peer, socket_type)
            peer.wait_closed()
            peer.close()
        peer = fake.live_egress()
        run.until("connected")
        peer.send(message(*frames("gait/event", FINAL)))
        said = run.until("final")
    assert said["statistics"]["violations"] == len(rude)
    assert said["statistics"]["failures"] == 0


def test_a_server_that_stalls_in_a_frame_does_not_hold_the_game(unity: UnityPackage, fake: FakeService) -> None:
    with unity.play(fake.endpoints) as run:
        peer = fake.live_egress()
        run.until("connected")
        data = message(*frames("gait/event", step(5)))
        peer.send(data[:40])
        for _ in range(5):
            run.until("frames")
        peer.send(data[40:])
        peer.send(message(b"user/gait/event")[:-3])
        # A stall that lasts ends the connection, and the next one is as good as new.
        again = fake.live_egress()
        run.until("connected")
        again.send(message(*frames("gait/event", FINAL)))
        said = run.until("final")
    assert said["steps"] == [5]
    assert said["statistics"]["stalls"] >= 1


def test_a_server_that_takes_nothing_does_not_hold_the_game(unity: UnityPackage, fake: FakeService) -> None:
    with unity.play(fake.endpoints) as run:
        peer = fake.live_egress()
        run.until("connected")
        # PINGs without end, and nobody who reads the answers: they fill the pipe and then hold the sender.
        pings = frame(b"\x04PING\x00\x0a" + bytes(200), COMMAND) * 1000
        with pytest.raises(ConnectionError):
            while True:
                peer.send(pings)
        assert run.until("disconnected")["why"].endswith("takes nothing any more")
        again = fake.live_egress()
        again.send(message(*frames("gait/event", FINAL)))
        run.until("final")


def test_ping_is_answered_and_subscribe_of_zmtp_3_1_is_understood(unity: UnityPackage, fake: FakeService) -> None:
    with unity.play(fake.endpoints) as run:
        run.until("frames")
        peer = fake.ingress()
        peer.shake_hands(b"XSUB")
        peer.send(frame(b"\x04PING\x00\x0acontext", COMMAND))
        assert peer.read_frame() == (COMMAND, b"\x04PONGcontext")
        peer.send(frame(b"\x09SUBSCRIBE", COMMAND))
        flags, topic = peer.read_frame()
        assert (flags, topic) == (MORE, b"user/head/pose")
        head = decode((topic, peer.read_frame()[1]))
        # No clock without an answer to `time`: fusion must not use it.
        assert not head.valid
        assert head.seq > 0  # what was published before has left a gap
        peer.send(frame(b"\x06CANCEL", COMMAND))
        before = run.until("frames")["statistics"]["unsent_no_bus"]
        while run.until("frames")["statistics"]["unsent_no_bus"] <= before:
            pass


@pytest.mark.parametrize(
    "answer",
    [b"", b"\xc1", b"\x81\xa2ok\xc3", msgpack.packb({"ok": True, "result": {"t": float("nan")}})],
    ids=["nothing", "no msgpack", "no result", "NaN"],
)
@pytest.mark.parametrize("honest", [False, True], ids=["hello", "time"])
def test_a_control_socket_that_answers_nonsense_gives_no_clock(
    unity: UnityPackage, fake: FakeService, answer: bytes, honest: bool
) -> None:
    with unity.play(fake.endpoints) as run:
        peer = fake.control()
        peer.shake_hands(b"ROUTER")
        assert peer.read_frame() == (MORE, b"")
        assert msgpack.unpackb(peer.read_frame()[1]) == {"cmd": "hello", "args": {}}
        if honest:
            session = SessionInfo().body().model_dump()
            peer.send(message(b"", msgpack.packb({"ok": True, "result": session})))
            assert peer.read_frame() == (MORE, b"")
            assert msgpack.unpackb(peer.read_frame()[1]) == {"cmd": "time", "args": {}}
        peer.send(message(b"", answer))
        peer.wait_closed()
        while (said := run.until("frames"))["statistics"]["bad_answers"] == 0:
            pass
    assert not said["synchronised"]
    assert said["statistics"]["failures"] == 0


def test_a_service_of_another_major_says_so_at_hello(unity: UnityPackage, fake: FakeService) -> None:
    session = SessionInfo().body().model_dump()
    session["protocol"]["major"] = 2
    with unity.play(fake.endpoints) as run:
        peer = fake.control()
        peer.shake_hands(b"ROUTER")
        for _ in range(2):
            peer.read_frame()
        peer.send(message(b"", msgpack.packb({"ok": True, "result": session})))
        peer.wait_closed()
        while (said := run.until("frames"))["statistics"]["violations"] == 0:
            pass
    assert not said["synchronised"]
