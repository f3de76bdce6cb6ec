"""A program in Python as a game has it, which tells the test what it sees, a line of JSON at a time.

Run as a program: ``python_game.py ENDPOINTS same|other``, the endpoints as JSON. It publishes a head, as "python"; the
gait event "stop" with the step FINAL ends it.
"""

from __future__ import annotations

import asyncio
import json
import sys
from typing import Any

from client_traffic import FINAL, UPRIGHT
from godot_project import LINE

from foottrack_client import AsyncClient, AsyncSubscription, Endpoints, Statistics
from foottrack_protocol.messages import HeadPose

FRAME_S = 0.02
FRAMES_PER_LINE = 10


def say(kind: str, **values: Any) -> None:
    print(LINE + json.dumps({"kind": kind, **values}), flush=True)


def as_json(statistics: Statistics) -> dict[str, Any]:
    """A subscription's counters."""
    topics = {
        name: {"messages": topic.messages, "gaps": topic.gaps, "drops": dict(topic.drops)}
        for name, topic in statistics.topics.items()
    }
    return {"topics": topics, "drops": dict(statistics.drops), "connections": statistics.connections}


def counters(client: AsyncClient, subscription: AsyncSubscription) -> dict[str, Any]:
    return {**as_json(subscription.statistics), "offset_ns": client.clock.offset}


async def frames(client: AsyncClient, subscription: AsyncSubscription) -> None:
    head = HeadPose(p=(0.25, 1.5, -0.5), q=UPRIGHT, tracked=True)
    bus = asyncio.ensure_future(client.publisher("python", 3600.0))
    found = 0
    for frame in range(1_000_000_000):
        if bus.done():
            bus.result().publish("head/pose", head)
        if subscription.statistics.connections > found:
            found = subscription.statistics.connections
            say("connected")
        if frame % FRAMES_PER_LINE == 0:
            statistics = counters(client, subscription)
            say("frames", synchronised=client.clock.is_fresh, statistics=statistics)
        await asyncio.sleep(FRAME_S)


async def main(endpoints: Endpoints, same_host: bool) -> None:
    with AsyncClient(endpoints, same_host=same_host) as client:
        subscription = client.subscribe("pose/", "gait/")
        async with asyncio.TaskGroup() as tasks:
            work = [tasks.create_task(frames(client, subscription))]
            if not same_host:
                work.append(tasks.create_task(client.keep_synchronised()))
            steps = []
            async for message in subscription:
                if message.data == FINAL:
                    break
                if message.stream == "gait/event":
                    steps.append(message.data.step)
            say("final", steps=steps, statistics=counters(client, subscription))
            for task in work:
                task.cancel()


if __name__ == "__main__":
    asyncio.run(main(Endpoints(*json.loads(sys.argv[1])), sys.argv[2] == "same"))
