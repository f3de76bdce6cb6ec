"""Where forward is: where the pelvis faces, not where the head looks."""

from __future__ import annotations

import math
from typing import Final

from foottrack_service.gait.samples import FootSample, HeadSample
from foottrack_service.gait.steps import yaw_of

_FEET_S: Final = 0.25
"""s: how fast the heading follows the feet."""
_HEAD_S: Final = 1.0
"""s: and the head, where no foot is known."""
_AIRBORNE: Final = 0.3
"""Weight of a foot in the air beside one that stands."""


class Heading:
    """The pelvis' yaw: between the feet, those that stand first; the slow head's where no foot is known."""

    def __init__(self) -> None:
        self._yaw: float | None = None

    def update(
        self, dt: float, left: FootSample | None, right: FootSample | None, head: HeadSample | None
    ) -> tuple[float, float, float]:
        """Unit vector, stage, on the floor; -Z until something is known."""
        east = north = 0.0
        for foot in (left, right):
            if foot is not None:
                weight = 1.0 if foot.contact else _AIRBORNE
                yaw = yaw_of(foot)
                east += weight * math.sin(yaw)
                north += weight * math.cos(yaw)
        if east * east + north * north > 1e-6:
            self._follow(math.atan2(east, north), dt, _FEET_S)
        elif head is not None:
            _, y, _, w = head.q
            if y * y + w * w > 1e-6:
                self._follow(2.0 * math.atan2(y, w), dt, _HEAD_S)
        yaw = self._yaw or 0.0
        return (-math.sin(yaw), 0.0, -math.cos(yaw))

    def _follow(self, wanted: float, dt: float, time_constant: float) -> None:
        if self._yaw is None:
            self._yaw = wanted
        share = 1.0 - math.exp(-max(dt, 0.0) / time_constant)
        self._yaw += share * math.remainder(wanted - self._yaw, 2.0 * math.pi)
