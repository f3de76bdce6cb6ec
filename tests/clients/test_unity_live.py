"""The Unity package against the running service: nothing lost, found again after a restart, an avatar that follows."""

from __future__ import annotations

import math
from typing import Any

import pytest
from client_traffic import FINAL, POSE, UPRIGHT, foot, step
from godot_project import GodotRun
from live_service import LiveService
from unity_mono import UnityPackage

from foottrack_client import Client, Publisher
from foottrack_protocol import Message
from foottrack_protocol.messages import BodyPose, HeadPose, IkFoot, IkTargets, Pose

pytestmark = pytest.mark.engine
EVENTS = 2000
QUARTER_LEFT = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))


def publisher_of(client: Client) -> Publisher:
    made = client.publisher("test")
    made.wait_ready()
    return made


def until_shown(run: GodotRun, publisher: Publisher, stream: str, body: Any, shown: Any) -> dict[str, Any]:
    """Publishes a body until the avatar stands as is due."""
    while True:
        # A pose that is a while old is no pose any more: an avatar only follows what keeps coming.
        publisher.publish(stream, body)
        said = run.until("frames")
        if shown(said):
            return said


def test_events_are_lossless_and_poses_the_newest(unity: UnityPackage, service: LiveService) -> None:
    with unity.play(service.endpoints) as run, Client(service.endpoints) as client:
        publisher = publisher_of(client)
        run.until("connected")
        for number in range(EVENTS):
            publisher.publish("gait/event", step(number))
            publisher.publish("pose/body", POSE)
        publisher.publish("gait/event", FINAL)
        said = run.until("final")
        ended = run.until("ended")
    assert said["steps"] == list(range(EVENTS))
    assert said["poses"] == sorted(set(said["poses"])) and len(said["poses"]) < EVENTS
    topics = said["statistics"]["topics"]
    assert topics["user/pose/body"]["messages"] == EVENTS
    assert topics["user/pose/body"]["gaps"] == topics["user/gait/event"]["gaps"] == 0
    assert said["statistics"]["unread"]["refused"] == {}
    assert said["statistics"]["overflow"] == said["statistics"]["failures"] == 0
    assert ended["disable_ms"] < 1000  # threads that had to be given up would take longer


def test_a_service_that_restarts_twice_is_found_again_and_the_loss_is_exact(
    unity: UnityPackage, service: LiveService
) -> None:
    with unity.play(service.endpoints) as run, Client(service.endpoints) as client:
        publisher = client.publisher("test")
        number = 0
        sessions = set()
        for restarts in range(3):
            publisher.wait_ready()
            run.until("connected")
            for _ in range(50):
                assert publisher.publish("gait/event", step(number))
                number += 1
            while True:
                said = run.until("frames", synchronised=True)["statistics"]
                counted = said["topics"].get("user/gait/event", {"messages": 0})
                if counted["messages"] == 50 * (restarts + 1) and said["session"] not in sessions:
                    break
            sessions.add(said["session"])
            if restarts == 2:
                break
            service.stop()
            assert run.until("disconnected")["why"]
            while publisher.live:
                pass
            for _ in range(7):
                assert not publisher.publish("gait/event", step(number))
                number += 1
            service.start()
        publisher.publish("gait/event", FINAL)
        said = run.until("final")
    assert said["steps"] == [*range(50), *range(57, 107), *range(114, 164)]
    assert said["statistics"]["topics"]["user/gait/event"]["gaps"] == 14
    assert said["statistics"]["welcomes"] == 3
    assert len(sessions) == 3


def test_head_poses_are_stamped_on_the_bus_clock_in_the_wire_s_axes(unity: UnityPackage, service: LiveService) -> None:
    with Client(service.endpoints) as client, client.subscribe("head/pose") as heads:
        heads.wait_ready()
        began = client.clock()
        with unity.play(service.endpoints) as run:
            run.until("frames", synchronised=True)
            received: list[Message] = []
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
    assert isinstance(body, HeadPose) and body.tracked
    assert body.p == pytest.approx((0.25, 1.5, -0.5), abs=1e-6)
    assert body.q == pytest.approx(QUARTER_LEFT, abs=1e-6)


def test_an_avatar_stands_where_its_user_stands(unity: UnityPackage, service: LiveService) -> None:
    def turned(x: float) -> dict[str, Any]:
        return {"ankle": Pose(p=(2.0, 0.2, x), q=QUARTER_LEFT)}

    # The user stands 2 m to the right of the stage's origin, turned to the left: his left foot is nearer to -Z's
    # opposite, which is Unity's -z. Feet 0.11 m above the floor; legs of 0.82 m to the avatar's 0.9.
    body = BodyPose(
        head=Pose(p=(2.0, 1.6, 0.0), q=QUARTER_LEFT),
        hips=Pose(p=(2.0, 0.85, 0.0), q=QUARTER_LEFT),
        left=foot(-0.1, **turned(0.1), hip=(2.0, 0.85, 0.1), knee=(1.95, 0.5, 0.1)),
        right=foot(0.1, **turned(-0.1), hip=(2.0, 0.85, -0.1), knee=(1.95, 0.5, -0.1)),
    )
    leg = math.dist((0.85, 0.0), (0.5, 0.05)) + math.dist((0.5, 0.05), (0.2, 0.0))
    scale = leg / 0.9
    lift = 0.1 * scale - 0.09  # the scaled avatar's ankle joints against the user's
    with unity.play(service.endpoints) as run, Client(service.endpoints) as client:
        publisher = publisher_of(client)
        run.until("connected")

        def settled(said: dict[str, Any]) -> bool:
            return bool(said["left_weight"] == 1.0) and abs(said["hips"][1] - (0.85 + lift)) < 1e-3

        said = until_shown(run, publisher, "pose/body", body, settled)
        assert said["scale"] == pytest.approx(scale, rel=1e-3)
        assert said["root"] == pytest.approx([2.0, 0.0, 0.0], abs=1e-3)
        assert said["forward"] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-3)
        assert said["hips"] == pytest.approx([2.0, 0.85 + lift, 0.0], abs=2e-3)
        assert said["left"] == pytest.approx([2.0, 0.2 + lift, -0.1], abs=1e-3)
        assert said["right"] == pytest.approx([2.0, 0.2 + lift, 0.1], abs=1e-3)
        assert said["left_toes"] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-3)
        # Nothing comes any more: the feet go back to the animation.
        while run.until("frames")["left_weight"] > 0.0:
            pass


def test_a_foot_that_is_lost_or_not_valid_is_let_go(unity: UnityPackage, service: LiveService) -> None:
    with unity.play(service.endpoints) as run, Client(service.endpoints) as client:
        publisher = publisher_of(client)
        run.until("connected")
        until_shown(run, publisher, "pose/body", POSE, lambda said: said["left_weight"] == 1.0)
        lost = BodyPose(left=foot(-0.1, stage="lost"), right=foot(0.1))
        until_shown(run, publisher, "pose/body", lost, lambda said: said["left_weight"] == 0.0)
        until_shown(run, publisher, "pose/body", POSE, lambda said: said["left_weight"] == 1.0)
        while True:
            publisher.publish("pose/body", POSE, valid=False)
            if run.until("frames")["left_weight"] == 0.0:
                break


def test_an_avatar_walks_where_its_user_walks_in_place(unity: UnityPackage, service: LiveService) -> None:
    def ik(x: float) -> IkFoot:
        return IkFoot(p=(x, 0.12, -0.3), q=UPRIGHT, hint=(x, 0.5, -1.0))

    def walk(speed: float) -> IkTargets:
        return IkTargets(
            mode="walk", left=ik(-0.1), right=ik(0.1), pelvis_dy=-0.05, speed=speed, heading=(-1.0, 0.0, 0.0)
        )

    with unity.play(service.endpoints, "WalkInPlace") as run, Client(service.endpoints) as client:
        publisher = publisher_of(client)
        run.until("connected")
        walked = until_shown(run, publisher, "pose/ik", walk(2.0), lambda said: said["root"][0] < -0.5)
        assert walked["root"][1:] == pytest.approx([0.0, 0.0], abs=1e-6)
        assert walked["forward"] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-6)

        def settled(said: dict[str, Any]) -> bool:
            return bool(said["left_weight"] == 1.0) and abs(said["hips"][1] - 0.95) < 1e-3

        said = until_shown(run, publisher, "pose/ik", walk(0.0), settled)
    x = said["root"][0]
    # Ahead (-Z) of the avatar is -x here, its left is -z; ankles are 0.01 m higher above the sole than the user's.
    assert said["left"] == pytest.approx([x - 0.3, 0.13, -0.1], abs=1e-4)
    assert said["right"] == pytest.approx([x - 0.3, 0.13, 0.1], abs=1e-4)
