"""How many simulated pictures a second this machine can draw and search, beside everything else."""

from __future__ import annotations

import os
import time
from statistics import median
from typing import NamedTuple

from foottrack_service.config import Settings

RATES_HZ = (60.0, 30.0, 15.0, 10.0)
"""With fewer, no two finds are near enough to confirm each other."""
_PICTURES = 10
_SHARE = 0.8
"""Of a core, for the camera's process: fusion has the other one, or what is left of the only one."""


class PictureRate(NamedTuple):
    """``hz`` that can be kept up when a picture costs ``cost_s`` of a core."""

    hz: float
    cost_s: float


def affordable(settings: Settings) -> PictureRate:
    """Draw and search a few pictures of the configured simulation, and see. Raises SourceError, ValueError."""
    import cv2

    from foottrack_service.camera.setup import Trackers, open_source

    before = cv2.getNumThreads()
    # As in the camera's process.
    cv2.setNumThreads(1)
    source = open_source(settings, None)
    try:
        trackers = Trackers(settings.camera, source.intrinsics)
        costs = []
        for _ in range(_PICTURES):
            began = time.perf_counter()
            trackers.process(source.read())
            costs.append(time.perf_counter() - began)
    finally:
        source.close()
        cv2.setNumThreads(before)
    return PictureRate(rate_for(median(costs), os.cpu_count() or 1), median(costs))


def rate_for(cost_s: float, cores: int) -> float:
    """The highest of the rates that a picture's cost allows, Hz; the lowest where none does."""
    share = _SHARE if cores > 1 else 0.5 * _SHARE
    return next((hz for hz in RATES_HZ if hz * cost_s <= share), RATES_HZ[-1])
