"""Optical measurements of drawn pictures: each is searched by the very trackers that a real camera's go through.

Without clocks: a picture costs no time, and its finds arrive as late as a real camera's.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache

import cv2

from foottrack_protocol import Message
from foottrack_service.camera.frame import SourceEnded
from foottrack_service.camera.setup import Trackers, open_source
from foottrack_service.config import FusionSettings, Settings
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.scenario import Scenario

SEARCH_S = 0.003
"""From a picture's arrival to its finds on the bus: what tracked pictures take."""
_HOP_NS = 150_000


def with_pictures(
    scenario: Scenario, feet: Feet = "mild", fps: float = 60.0, covered_from: float | None = None
) -> Iterator[tuple[int, Message]]:
    """A scenario's messages in order of arrival, ns, with the finds of its pictures for the camera's.

    ``feet`` are those that the scenario was simulated with; from ``covered_from`` s on trouser legs hang over the tags.
    Deterministic. Raises SourceError for settings that no camera can have.
    """
    rest = (
        (arrival, message)
        for arrival, message in scenario.messages()
        if not message.stream.startswith(("marker/", "depth/"))
    )
    seen_by = scenario.settings.model_copy(update={"fusion": FusionSettings()}).model_dump_json()
    finds = found_in_pictures(scenario.task, scenario.seed, scenario.seconds, feet, seen_by, fps, covered_from)
    shifted = (
        (arrival + scenario.start, message._replace(t=message.t + scenario.start, t_pub=message.t_pub + scenario.start))
        for arrival, message in finds
    )
    return heapq.merge(rest, shifted, key=lambda pair: pair[0])


@lru_cache(maxsize=1)
def found_in_pictures(
    task: str, seed: int, seconds: float, feet: Feet, settings_json: str, fps: float, covered_from: float | None = None
) -> tuple[tuple[int, Message], ...]:
    """``marker/*`` and ``depth/*`` of a scenario that begins at 0, with arrivals, ns; kept for the next filter."""
    settings = Settings.model_validate_json(settings_json)
    cv2.setNumThreads(1)
    scene: dict[str, object] = {"task": task, "seed": seed, "seconds": seconds, "feet": feet, "fps": fps, "start": 0}
    if covered_from is not None:
        scene["covered"] = [(covered_from, seconds + 1.0)]
    source = settings.camera.source
    rendered = type(source.rendered).model_validate({**source.rendered.model_dump(), **scene})
    source = source.model_copy(update={"kind": "rendered", "rendered": rendered})
    settings = settings.model_copy(update={"camera": settings.camera.model_copy(update={"source": source})})
    pictures = open_source(settings, None)
    trackers = Trackers(settings.camera, pictures.intrinsics)
    late = round((rendered.latency + SEARCH_S) * 1e9)
    numbers: Counter[str] = Counter()
    found: list[tuple[int, Message]] = []
    while True:
        try:
            frame = pictures.read()
        except SourceEnded:
            return tuple(found)
        published = frame.t + late
        for fix in trackers.process(frame):
            stream = f"{fix.kind}/{fix.side}"
            number = numbers[stream]
            numbers[stream] += 1
            message = Message(settings.user, stream, "camera", "rendered", number, fix.t, published, True, fix.body())
            found.append((published + _HOP_NS, message))
