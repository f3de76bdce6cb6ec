"""How a foot rolls over its forefoot without slipping: from the ball, where it stands flat, to the toes' tip."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import make_interp_spline

from foottrack_service.rotations import Array
from foottrack_service.simulation.anatomy import Sole
from foottrack_service.simulation.easing import ease

_LEAST_SPRING = np.radians(5.0)  # rad: a sole that does not rise towards the toes still bends a little


class Rocker:
    """The forefoot as a smooth convex curve that rolls on the floor.

    With `r(pitch)` the radius of curvature, the contact moves by r d(pitch) along the floor and along the sole alike.
    For pitches up to twice the slope from ball to toes the contact travels between them; beyond, the foot stands on its
    toes. All lengths m, angles rad, `pitch` (n,) with the heel up.
    """

    def __init__(self, sole: Sole) -> None:
        rise, run = sole.ankle_height - sole.toe_height, sole.toe_z - sole.ball_z
        slope = max(np.arctan2(rise, run), _LEAST_SPRING)
        self._end = 2.0 * slope
        pitch = np.linspace(0.0, self._end, 60)
        share = pitch / self._end
        bump = 30.0 * share**2 * (1.0 - share) ** 2 / self._end
        ahead = make_interp_spline(pitch, bump * np.cos(pitch), k=5).antiderivative()
        up = make_interp_spline(pitch, bump * np.sin(pitch), k=5).antiderivative()
        self._length = float(np.hypot(rise, run) / np.hypot(ahead(self._end), up(self._end)))
        self._ahead, self._up, self._sole = ahead, up, sole

    def contact(self, pitch: Array) -> tuple[Array, Array]:
        """Where the sole touches the floor: ahead of the ankle and below it, foot frame."""
        p = np.clip(pitch, 0.0, self._end)
        ahead = self._sole.ball_z + self._length * self._ahead(p)
        return ahead, self._sole.ankle_height - self._length * self._up(p)

    def ankle(self, pitch: Array) -> tuple[Array, Array]:
        """The ankle's forward (from the ball's place while flat) and up."""
        ahead, below = self.contact(pitch)
        sine, cosine = np.sin(pitch), np.cos(pitch)
        travelled = self._length * ease(pitch / self._end)  # whose derivative is the bump
        return travelled + below * sine - ahead * cosine, below * cosine + ahead * sine

    def radius(self, pitch: float) -> float:
        """Radius of curvature at the contact."""
        share = min(max(pitch / self._end, 0.0), 1.0)
        return float(self._length * 30.0 * share**2 * (1.0 - share) ** 2 / self._end)


@lru_cache(maxsize=16)
def rocker(sole: Sole) -> Rocker:
    """The forefoot of this sole."""
    return Rocker(sole)
