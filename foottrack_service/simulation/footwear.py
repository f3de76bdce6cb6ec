"""How a foot lands: 'mild' feet as planned, 'hard' ones with impacts, slap and soft soles."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from foottrack_service import rotations
from foottrack_service.rotations import Array
from foottrack_service.simulation import noise
from foottrack_service.simulation.anatomy import Sole
from foottrack_service.simulation.footsteps import FootSamples
from foottrack_service.simulation.truth import GRID_HZ, FootTrack

Feet = Literal["mild", "hard"]

# Peaks of real heel strikes at the shoe are 45 to 170 m/s^2 (walking to running); a walk has 40 to 110.
_STRIKE_PEAK = (40.0, 110.0)  # m/s^2
_SLAP_PEAK = (15.0, 40.0)  # m/s^2, when the forefoot hits the floor
_IMPACT_S = 0.024  # s, width of the deceleration's pulse at the shoe
_SOFT_SINK = 0.004  # m, a soft sole under the body's weight
_SOFT_SWAY = np.array([0.0008, 0.0005, 0.0008])  # m SD in stance on it
_SOFT_TILT = np.radians([0.35, 0.2, 0.35])  # SD in stance on it
_SOFT_BAND_HZ = 3.0  # Hz, of the sway: a person's balancing and its tremor


def track(foot: FootSamples, sole: Sole, feet: Feet, random: np.random.Generator) -> FootTrack:
    """The foot's track, with what its shoe adds."""
    p, q = foot.p, foot.q
    # Drawn for both kinds, so that mild and hard feet walk the same way.
    hardness = np.random.default_rng(random.integers(2**63))
    if feet == "hard":
        p = p + _impacts(foot, hardness)
        load = _load(foot)[:, None]
        p = p + load * (
            noise.wander(hardness, len(foot.t), GRID_HZ, _SOFT_BAND_HZ, _SOFT_SWAY) - [0.0, _SOFT_SINK, 0.0]
        )
        tilt = load * noise.wander(hardness, len(foot.t), GRID_HZ, _SOFT_BAND_HZ, _SOFT_TILT)
        q = rotations.multiply(q, rotations.from_rotation_vector(tilt))
    return FootTrack(
        foot.t,
        p,
        q,
        heel=foot.heel,
        toe=foot.toe,
        heel_point=sole.heel,
        ball_point=sole.ball,
        strikes=foot.strikes,
    )


def _impacts(foot: FootSamples, random: np.random.Generator) -> Array:
    """The shoe gives way and comes back: at most 3 mm, within `_IMPACT_S`; (n, 3) m."""
    give = np.zeros_like(foot.p)
    for instants, (low, high) in ((foot.strikes, _STRIKE_PEAK), (foot.flats, _SLAP_PEAK)):
        for instant in instants:
            peak = random.uniform(low, high)
            direction = np.array([0.3 * random.uniform(-1, 1), 1.0, 0.3 * random.uniform(-1, 1)])
            u = np.clip((foot.t - instant) / _IMPACT_S, 0.0, 1.0)
            # (4u(1-u))^4 has the second derivative -32 in its middle and three continuous ones at its ends.
            give -= (peak * _IMPACT_S**2 / 32.0) * ((4.0 * u * (1.0 - u)) ** 4)[:, None] * direction
    return give


def _load(foot: FootSamples) -> Array:
    """How much weight the foot carries, 0 to 1, smooth; (n,)."""
    flat = (foot.heel & foot.toe).astype(np.float64)
    load: Array = gaussian_filter1d(minimum_filter1d(flat, round(0.1 * GRID_HZ)), 0.02 * GRID_HZ, mode="nearest")
    return load
