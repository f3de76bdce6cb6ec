"""What ``foottrack walk`` writes: by the file's ending, whole or not at all; and what it puts on the bus."""

from __future__ import annotations

import asyncio
import heapq
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foottrack_service.cli.joining import joined
from foottrack_service.cli.running import EXIT_USAGE, CommandFailed

if TYPE_CHECKING:
    import numpy as np

    from foottrack_service.config import Settings
    from foottrack_service.walkcycle.cycle import Cycle
    from foottrack_service.walkcycle.project import Project
    from foottrack_service.walkcycle.walk import Walk

ENDINGS = (".bvh", ".glb", ".mcap", ".json")
SOURCE = "walk"
LEAD_NS = 20_000_000
"""So much before the first instant everything is ready."""
RATE_HZ = 100.0


def check_ending(out: Path, allowed: tuple[str, ...] = ENDINGS) -> str:
    """The ending that chooses the format. Raises CommandFailed before anything is worked out or written."""
    ending = out.suffix.lower()
    if ending not in allowed:
        raise CommandFailed(
            f"--out {out}: the ending chooses the format, and is one of {', '.join(allowed)}", EXIT_USAGE
        )
    if not out.parent.is_dir():
        raise CommandFailed(f"--out {out}: there is no folder {out.parent}", EXIT_USAGE)
    return ending


def write_whole(out: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    descriptor, name = tempfile.mkstemp(dir=out.parent, prefix=f".{out.name}.")
    part = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(data)
        # mkstemp's files are their owner's alone.
        part.chmod(0o644)
        part.replace(out)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise CommandFailed(f"--out {out}: {error.strerror or error}") from None


def walk_file(walk: Walk, project: Project, ending: str, fps: float) -> bytes:
    """A walk on its path as the bytes of a .bvh, .glb or .json file."""
    from foottrack_service.walkcycle.bvh import format_bvh
    from foottrack_service.walkcycle.frames import even_frames
    from foottrack_service.walkcycle.glb import format_glb, key_times
    from foottrack_service.walkcycle.project import format_project

    if ending == ".bvh":
        return format_bvh(walk.body, even_frames(walk, fps).motion(walk)).encode()
    if ending == ".glb":
        return format_glb(walk.body, walk.motion(key_times(walk, fps)), project.name)
    return format_project(project).encode()


def cycle_file(cycle: Cycle, ending: str, fps: float) -> bytes:
    """One cycle on the spot that closes, its last frame its first, as .bvh or .glb."""
    from dataclasses import replace

    import numpy as np

    from foottrack_service.walkcycle.bvh import format_bvh
    from foottrack_service.walkcycle.glb import format_glb
    from foottrack_service.walkcycle.inplace import in_place

    frames = max(4, round(cycle.period * fps))
    motion = in_place(cycle, np.linspace(0.0, 1.0, frames + 1))
    motion = replace(motion, times=np.arange(frames + 1) / fps)
    return format_bvh(cycle.body, motion).encode() if ending == ".bvh" else format_glb(cycle.body, motion)


def record_walk(walk: Walk, settings: Settings, out: Path, rate_hz: float = RATE_HZ) -> int:
    """Write the streams that a person walking so would cause as a recording; says how many messages.

    Raises RecordingError.
    """
    from foottrack_protocol import encode
    from foottrack_protocol.envelope import Message
    from foottrack_service.config import to_toml
    from foottrack_service.recording.file import RecordingFile

    numbers: dict[str, int] = {}
    with RecordingFile(out, to_toml(settings), 0) as file:
        for t, stream, body in stream_bodies(walk, rate_hz):
            number = numbers.get(stream, 0)
            numbers[stream] = number + 1
            message = Message(settings.user, stream, SOURCE, "offline", number, t, t, True, body)
            topic, payload = encode(message)
            file.add(topic, payload, t, t, number)
        return file.messages


def stream_bodies(walk: Walk, rate_hz: float) -> Iterator[tuple[int, str, Any]]:
    """(ns since the walk's beginning, stream, body) in order of time."""
    import numpy as np

    from foottrack_service.walkcycle.wire import wire_events, wire_instants

    def instants() -> Iterator[tuple[int, int, str, Any]]:
        times = walk.times(rate_hz)
        for block in np.array_split(times, max(1, len(times) // 200)):
            yield from _bodies(walk, block)

    def _bodies(walk: Walk, block: np.typing.NDArray[np.float64]) -> Iterator[tuple[int, int, str, Any]]:
        for instant in wire_instants(walk, block):
            t = round(instant.time * 1e9)
            yield t, 1, "pose/body", instant.pose
            yield t, 2, "pose/ik", instant.ik
            yield t, 3, "gait/state", instant.gait

    events = ((round(time * 1e9), 0, "gait/event", event) for time, event in wire_events(walk))
    for t, _, stream, body in heapq.merge(events, instants(), key=lambda item: item[:2]):
        yield t, stream, body


async def play_walk(walk: Walk, settings: Settings, rate_hz: float = RATE_HZ, *, loop: bool = False) -> int:
    """Publish a walk on a running bus in real time; says how many messages. Raises NotReady when no bus answers."""
    bodies = list(stream_bodies(walk, rate_hz))
    async with joined(settings) as bus:
        publisher = bus.publisher(SOURCE)
        try:
            await publisher.ready()
            start = bus.clock() + LEAD_NS
            while True:
                for t, stream, body in bodies:
                    wait = start + t - bus.clock()
                    if wait > 0:
                        await asyncio.sleep(wait * 1e-9)
                    publisher.publish(settings.user, stream, start + t, body)
                if not loop:
                    return publisher.sent
                start += round(walk.duration * 1e9)
        finally:
            publisher.close()
