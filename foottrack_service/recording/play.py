"""Plays a recording on a bus where nobody else speaks on its topics."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection

from foottrack_protocol import TopicError, split_topic, topic_name
from foottrack_protocol.topics import Role
from foottrack_service.bus.connection import Bus
from foottrack_service.recording.errors import ReplayRefusedError
from foottrack_service.recording.live_replay import LiveReplay, Status
from foottrack_service.recording.recording import Recording

SOURCE = "replay"
LISTEN_S = 1.5
"""How long to listen for live publishers: a stream that matters comes at least once a second."""


async def play(
    bus: Bus,
    recording: Recording,
    *,
    rate: float = 1.0,
    loop: bool = False,
    user: str | None = None,
    roles: Collection[Role] = tuple(Role),
    on_started: Callable[[LiveReplay], None] | None = None,
    listen_s: float = LISTEN_S,
) -> Status:
    """Play on a bus to the end, and say where it ended. ``on_started`` gets the replay, for keys and control socket.

    Raises ReplayRefusedError when somebody publishes one of the topics live, RecordingError, NotReady.
    """
    topics = replayed_topics(recording, user, roles)
    taken = sorted(topics & await live_topics(bus, {topic.partition("/")[0] for topic in topics}, listen_s))
    if taken:
        raise ReplayRefusedError(recording.path, taken)
    publisher = bus.publisher(SOURCE)
    try:
        await publisher.ready()
        replay = LiveReplay(recording, publisher.send, bus.clock, rate=rate, loop=loop, user=user, roles=roles)
        if on_started is not None:
            on_started(replay)
        await replay.run()
        return replay.status
    finally:
        publisher.close()


def replayed_topics(recording: Recording, user: str | None, roles: Collection[Role] = tuple(Role)) -> set[str]:
    """Topics on which a replay would publish."""
    found = set()
    for raw in recording.topics():
        try:
            owner, topic = split_topic(raw.decode())
        except (TopicError, UnicodeDecodeError):
            continue
        if not topic.is_system and topic.role in roles:
            found.add(topic_name(user or owner, topic.stream))
    return found


async def live_topics(bus: Bus, users: Collection[str], listen_s: float = LISTEN_S) -> set[str]:
    """Topics of these users that somebody publishes now."""
    subscriber = bus.subscriber([f"{user}/" for user in users])
    seen: set[str] = set()
    try:
        await subscriber.ready()
        async with asyncio.timeout(listen_s):
            async for received in subscriber:
                seen.add(received.message.topic)
    except TimeoutError:
        pass
    finally:
        subscriber.close()
    return seen
