"""The camera node with its own process, on a live bus."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from foottrack_protocol import Message
from foottrack_service import rotations
from foottrack_service.bus import Bus
from foottrack_service.camera import node
from foottrack_service.camera.process import SOURCE
from foottrack_service.config import CameraSettings, Settings

Run = Callable[[Any], Any]


def settings(**source: Any) -> Settings:
    """Settings with a source."""
    return Settings(camera=CameraSettings.model_validate({"source": source}))


async def listen(bus: Bus, given: Settings, until: Callable[[list[Message]], bool]) -> list[Message]:
    """What the node publishes until there is enough, or it ends."""
    subscriber = bus.subscriber([f"{given.user}/marker", f"{given.user}/depth", f"{given.user}/camera"])
    await subscriber.ready()
    messages: list[Message] = []
    enough = asyncio.Event()

    def take(batch: Any) -> None:
        messages.extend(received.message for received in batch)
        if until(messages):
            enough.set()

    delivery = asyncio.ensure_future(subscriber.deliver(take))
    camera = asyncio.ensure_future(node.run(bus, given))
    waiting = asyncio.ensure_future(enough.wait())
    await asyncio.wait({camera, waiting}, return_when=asyncio.FIRST_COMPLETED)
    for task in (camera, waiting, delivery):
        if not task.done():
            task.cancel()
    with suppress(asyncio.CancelledError):
        await camera
    return messages


def test_rendered_feet_arrive_where_the_simulation_has_them(run: Run, bus: Bus) -> None:
    start = bus.clock() + 1_500_000_000
    given = settings(
        kind="rendered",
        preview=True,
        rendered={"task": "still", "seed": 3, "seconds": 20.0, "fps": 30.0, "start": start},
    )

    def enough(messages: list[Message]) -> bool:
        count = Counter(message.stream for message in messages)
        return min(count["marker/left"], count["marker/right"]) >= 8 and count["camera/preview"] >= 2

    messages = run(listen(bus, given, enough))
    assert enough(messages)
    from foottrack_service.simulation.scenario import simulate

    truth = simulate("still", 3, settings=given, seconds=20.0, camera=False).truth
    for message in messages:
        if not message.stream.startswith("marker/"):
            continue
        side = message.stream.partition("/")[2]
        t = np.array([(message.t - start) * 1e-9])
        head_p, head_q = truth.head.pose(t)
        marker = given.feet.of(side).marker
        expected = rotations.unrotate(head_q, truth.feet[side].point(t, marker.p) - head_p)[0]
        assert np.linalg.norm(np.array(message.data.p) - expected) < 0.03
        assert message.data.size_ratio == pytest.approx(1.0, abs=0.1)
    jpeg = next(message.data.jpeg for message in messages if message.stream == "camera/preview")
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None and picture.shape == (480, 848, 3)
    frames = [message.data.frame for message in messages if message.stream == "marker/left"]
    assert frames == sorted(set(frames))


def test_a_recorded_sequence_ends_the_node_quietly(run: Run, bus: Bus, tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((480, 848), 10, np.uint8))
    lines = ["# timestamp filename", *(f"{100.0 + 0.01 * n:.2f} {n}.png" for n in range(3))]
    (tmp_path / "rgb.txt").write_text("\n".join(lines))
    given = settings(kind="folder", folder={"path": str(tmp_path)})
    run(node.run(bus, given))
    counted = bus.health.body().filters["user/camera"]
    # It plays at its own pace: a busy machine misses pictures, but none uncounted.
    assert set(counted.accepted) == {"pictures"}
    assert counted.accepted["pictures"] + counted.rejected.get("dropped", 0) == 3


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ({"kind": "none"}, "no camera is configured"),
        ({"kind": "folder", "folder": {"path": "none/such"}}, "rgb.txt"),
        ({"kind": "rendered", "rendered": {"task": "flying"}}, "no task is called 'flying'"),
    ],
)
def test_what_is_wrong_is_said(run: Run, bus: Bus, source: dict[str, Any], text: str) -> None:
    with pytest.raises(node.CameraError, match=text):
        run(node.run(bus, settings(**source)))


def test_a_killed_process_is_noticed(run: Run, bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    started = []
    original = node._start

    def start(given: Settings) -> Any:
        started.append(original(given))
        return started[0]

    monkeypatch.setattr(node, "_start", start)

    async def scenario() -> None:
        camera = asyncio.ensure_future(node.run(bus, settings(kind="rendered")))
        await bus.health.wait_running(SOURCE)
        started[0][0].kill()
        with pytest.raises(node.CameraError, match="died"):
            await camera

    run(scenario())
