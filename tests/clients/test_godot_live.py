"""The addon against the running service: nothing lost, found again after a restart, head poses that fusion can use."""

from __future__ import annotations

import pytest
from client_traffic import FINAL, POSE, ports, step
from godot_project import GodotProject
from live_service import LiveService

from foottrack_client import Client
from foottrack_protocol.messages import GaitEvent, HeadPose

pytestmark = pytest.mark.engine


def test_events_are_lossless_and_poses_the_newest(godot: GodotProject, service: LiveService) -> None:
    with godot.start("client.gd", ports(service.endpoints)) as run, Client(service.endpoints) as client:
        publisher = client.publisher("test")
        publisher.wait_ready()
        run.until("connected")
        for number in range(1500):
            publisher.publish("gait/event", step(number))
            publisher.publish("pose/body", POSE)
        publisher.publish("gait/event", FINAL)
        said = run.until("final")
    assert said["steps"] == list(range(1500))
    assert said["poses"] == sorted(set(said["poses"]))
    topics = said["statistics"]["topics"]
    assert topics["user/pose/body"]["messages"] == 1500
    assert topics["user/pose/body"]["gaps"] == topics["user/gait/event"]["gaps"] == 0
    assert said["statistics"]["drops"] == {}


def test_a_game_that_stands_still_loses_the_oldest_events_and_counts_them(
    godot: GodotProject, service: LiveService
) -> None:
    waiting, over = 10_000, 250
    with godot.start("client.gd", ports(service.endpoints)) as run, Client(service.endpoints) as client:
        publisher, reader = client.publisher("test"), client.subscribe("gait/event")
        publisher.wait_ready()
        reader.wait_ready()
        run.until("connected")
        publisher.publish("gait/event", GaitEvent(event="first_step", step=1 + waiting + over))
        run.until("standing")
        # No more than what the bus holds for a reader that is behind: another one reads along.
        for number in range(waiting + over):
            publisher.publish("gait/event", step(number))
            assert reader.receive(5.0) is not None
        while run.until("frames")["statistics"]["overflow"] == 0:
            pass
        publisher.publish("gait/event", FINAL)
        said = run.until("final")
    # The service's own messages of these seconds wait among them.
    oldest = said["steps"][0]
    assert said["steps"] == list(range(oldest, waiting + over))
    assert over <= oldest <= said["statistics"]["overflow"] < over + 50
    assert said["statistics"]["topics"]["user/gait/event"]["gaps"] == 0


def test_a_service_that_restarts_twice_is_found_again_and_the_loss_is_exact(
    godot: GodotProject, service: LiveService
) -> None:
    with godot.start("client.gd", ports(service.endpoints)) as run, Client(service.endpoints) as client:
        publisher = client.publisher("test")
        number = 0
        for restarts in range(3):
            publisher.wait_ready()
            run.until("connected")
            for _ in range(50):
                assert publisher.publish("gait/event", step(number))
                number += 1
            if restarts == 2:
                break
            while run.until("frames")["statistics"]["topics"]["user/gait/event"]["messages"] < 50 * (restarts + 1):
                pass
            session = run.until("frames", synchronised=True)["statistics"]["session"]
            service.stop()
            assert run.until("disconnected")["why"]
            while publisher.live:
                pass
            for _ in range(7):
                assert not publisher.publish("gait/event", step(number))
                number += 1
            service.start()
        while run.until("frames")["statistics"]["session"] == session:
            pass
        publisher.publish("gait/event", FINAL)
        said = run.until("final")
    assert said["steps"] == [*range(50), *range(57, 107), *range(114, 164)]
    assert said["statistics"]["topics"]["user/gait/event"]["gaps"] == 14
    assert said["statistics"]["welcomes"] == 3
    assert said["statistics"]["session"] != session


def test_a_wrong_port_is_told_in_words(godot: GodotProject, service: LiveService) -> None:
    right = ports(service.endpoints)
    with godot.start("client.gd", {**right, "egress": right["control"]}) as run:
        due = "a ROUTER socket answers to our SUB: is this the right port?"
        assert run.until("troubled")["why"] == due
    with godot.start("client.gd", {**right, "control": 1}) as run:
        run.until("troubled", why="nobody listens at 127.0.0.1:1: is the service running?")


def test_head_poses_are_stamped_on_the_bus_clock(godot: GodotProject, service: LiveService) -> None:
    settings = {**ports(service.endpoints), "head": True}
    with Client(service.endpoints) as client, client.subscribe("head/pose") as heads:
        heads.wait_ready()
        began = client.clock()
        with godot.start("client.gd", settings) as run:
            run.until("frames", synchronised=True)
            received = []
            while len([message for message in received if message.valid]) < 50:
                message = heads.receive(20.0)
                assert message is not None
                received.append(message)
            ended = client.clock()
    valid = [message for message in received if message.valid]
    assert [message.seq for message in received] == list(range(received[0].seq, received[0].seq + len(received)))
    # Right to the clock's own uncertainty, which is far below the 1 ms allowed for here.
    assert all(began < message.t <= message.t_pub < ended + 1_000_000 for message in valid)
    stamps = [message.t for message in valid]
    assert stamps == sorted(stamps)
    body = valid[-1].data
    assert isinstance(body, HeadPose)
    assert body.p == pytest.approx((0.25, 1.5, -0.5), abs=1e-6)
    assert body.q == pytest.approx((0.0, 0.5**0.5, 0.0, 0.5**0.5), abs=1e-6)
