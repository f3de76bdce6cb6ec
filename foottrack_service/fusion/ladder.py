"""The ladder of stages that a foot steps down as its sources fall silent (PROTOCOL, results), for every filter."""

from __future__ import annotations

import math

from foottrack_service.fusion.interface import COASTING_S, FIX_MEMORY_S, LOST_SIGMA_M, Kind, Stage

BALL_68_OF_ONE_AXIS = 1.8779
"""Radius of the ball that holds 68.27 % of an isotropic 3-D normal distribution, in standard deviations of one axis
(square root of the chi-square quantile with 3 degrees of freedom, 3.5267)."""

_NEVER = -(2**62)
_NS = 1e-9


class Ladder:
    """Remembers when each source last gave something that was used."""

    def __init__(self) -> None:
        self._fixes: dict[Kind, int] = {"marker": _NEVER, "depth": _NEVER}
        self._imu = _NEVER

    def saw_fix(self, kind: Kind, t: int) -> None:
        """A fix made at ``t`` (ns) was accepted."""
        self._fixes[kind] = max(self._fixes[kind], t)

    def saw_imu(self, t: int) -> None:
        """An IMU sample of ``t`` (ns) was used."""
        self._imu = max(self._imu, t)

    def imu_alive(self, t: int) -> bool:
        """Whether the IMU spoke within the last 0.1 s."""
        return (t - self._imu) * _NS <= FIX_MEMORY_S

    def fix_within(self, kind: Kind, t: int, seconds: float = FIX_MEMORY_S) -> bool:
        """Whether such a fix was accepted so recently."""
        return (t - self._fixes[kind]) * _NS <= seconds

    def age(self, t: int) -> float | None:
        """Seconds since the last accepted fix, None when there was none."""
        newest = max(self._fixes.values())
        return None if newest == _NEVER else max(0.0, (t - newest) * _NS)

    def stage(self, t: int, sigma: float) -> Stage:
        """The stage at ``t`` (ns) of an estimate whose ball of 68 % has the radius ``sigma`` (m)."""
        if sigma > LOST_SIGMA_M or math.isnan(sigma):
            return "lost"
        if self.fix_within("marker", t):
            return "marker"
        if self.fix_within("depth", t):
            return "depth"
        if self.imu_alive(t):
            return "inertial"
        newest = max(self._imu, *self._fixes.values())
        return "coasting" if (t - newest) * _NS <= FIX_MEMORY_S + COASTING_S else "lost"
