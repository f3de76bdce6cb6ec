"""Which filter runs: ``[fusion] filter``."""

from __future__ import annotations

from collections.abc import Callable

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.fusion.foot_filter import ErrorStateFilter
from foottrack_service.fusion.interface import FootFilter
from foottrack_service.fusion.reference import ReferenceFilter

MakeFilter = Callable[[Settings, Side], FootFilter]


def make_filter(settings: Settings, side: Side) -> FootFilter:
    """One foot's filter, as the settings choose it."""
    foot = settings.feet.of(side)
    if settings.fusion.filter == "reference":
        return ReferenceFilter(foot, side)
    return ErrorStateFilter(foot, side, floor=settings.fusion.floor)
