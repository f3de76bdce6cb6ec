"""The addon against a server that lies: it stays alive, counts, and its main thread never waits."""

from __future__ import annotations

import itertools
import random

import msgpack
import pytest
from client_traffic import FINAL, POSE, frames, ports, step
from fake_service import COMMAND, MORE, FakeService, frame, message, rude_greetings
from godot_project import GodotProject

from foottrack_protocol import DecodeError, decode

pytestmark = pytest.mark.engine


def mutations(count: int) -> list[tuple[bytes, bytes]]:
    """Payloads with bytes flipped, cut out and put in."""
    chance = random.Random(7)
    topic, good = frames("gait/event", step(1))
    made = []
    for _ in range(count):
        payload = bytearray(good)
        for _ in range(chance.randrange(1, 6)):
            at = chance.randrange(len(payload))
            action = chance.randrange(3)
            if action == 0:
                payload[at] = chance.randrange(256)
            elif action == 1:
                del payload[at : at + chance.randrange(1, 9)]
            else:
                payload[at:at] = chance.randbytes(chance.randrange(1, 9))
            payload = payload or bytearray(good)
        made.append((topic, bytes(payload)))
    return made


def refused(messages: list[tuple[bytes, bytes]]) -> dict[str, int]:
    """What our own decoder counts by reason."""
    counted: dict[str, int] = {}
    for item in messages:
        try:
            decode(item)
        except DecodeError as error:
            counted[error.reason] = counted.get(error.reason, 0) + 1
    return counted


def test_garbage_is_counted_and_the_next_good_message_is_taken(godot: GodotProject, fake: FakeService) -> None:
    fuzzed = mutations(800)
    with godot.start("client.gd", ports(fake.endpoints)) as run:
        peer = fake.live_egress()
        run.until("connected")
        for item in fuzzed:
            peer.send(message(*item))
        peer.send(message(b"user/gait/event"))
        peer.send(message(*[b"user/gait/event"] * 2000))
        for number in range(3000):
            peer.send(message(*frames("gait/event", step(1), user=f"made-up-{number}")))
        peer.send(message(b"user/pose/body", bytes(1_000_000)))
        peer.send(frame(b"\x07NOTHING" + bytes(50), COMMAND))
        peer.send(message(*frames("gait/event", step(2))) + message(*frames("gait/event", FINAL)))
        said = run.until("final")
    assert said["steps"][-1] == 2
    topics = said["statistics"]["topics"]
    counted = topics["user/gait/event"]
    due = refused(fuzzed)
    assert sum(counted["drops"].values()) == sum(due.values()) > 400
    assert counted["messages"] == len(fuzzed) - sum(due.values()) + 2
    assert topics["user/pose/body"]["drops"] == {"oversized": 1}
    assert said["statistics"]["drops"] == {"frames": 2}
    # What was not subscribed to takes no memory.
    assert set(topics) == {"user/gait/event", "user/pose/body"}


def test_another_major_is_told_in_words(godot: GodotProject, fake: FakeService) -> None:
    topic, payload = frames("pose/body", POSE)
    envelope = msgpack.unpackb(payload)
    with godot.start("client.gd", ports(fake.endpoints)) as run:
        peer = fake.live_egress()
        run.until("connected")
        peer.send(message(topic, msgpack.packb({**envelope, "v": 2})))
        said = run.until("refused")
    assert said["reason"] == "version"
    assert said["detail"] == "protocol 2, this side speaks 1"


def test_a_server_that_breaks_the_rules_is_left_and_asked_again(godot: GodotProject, fake: FakeService) -> None:
    rude = rude_greetings()
    with godot.start("client.gd", ports(fake.endpoints)) as run:
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


def test_a_server_that_stalls_in_a_frame_does_not_hold_the_game(godot: GodotProject, fake: FakeService) -> None:
    with godot.start("client.gd", ports(fake.endpoints)) as run:
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


def test_ping_is_answered_and_subscribe_of_zmtp_3_1_is_understood(godot: GodotProject, fake: FakeService) -> None:
    with godot.start("client.gd", {**ports(fake.endpoints), "head": True}) as run:
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
        before = run.until("frames")["statistics"]["unsent"]["no_bus"]
        while run.until("frames")["statistics"]["unsent"]["no_bus"] <= before:
            pass


@pytest.mark.parametrize(
    "answer",
    [b"", b"\xc1", b"\x81\xa2ok\xc3", msgpack.packb({"ok": True, "result": {"t": float("nan")}})],
    ids=["nothing", "no msgpack", "no result", "NaN"],
)
def test_a_control_socket_that_answers_nonsense_gives_no_clock(
    godot: GodotProject, fake: FakeService, answer: bytes
) -> None:
    with godot.start("client.gd", ports(fake.endpoints)) as run:
        peer = fake.control()
        peer.shake_hands(b"ROUTER")
        assert peer.read_frame() == (MORE, b"")
        assert msgpack.unpackb(peer.read_frame()[1]) == {"cmd": "hello", "args": {}}
        peer.send(message(b"", answer))
        peer.wait_closed()
        while (said := run.until("frames"))["statistics"]["bad_answers"] == 0:
            pass
    assert not said["synchronised"]
