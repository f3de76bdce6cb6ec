"""[Z]'s equations 1 to 8: where an avatar's feet go for a tracked foot height. +z is forward.

phi = 2 pi h / H with H = 4 y_max. ``s`` is the foot that steps, ``p`` the one that supports. As published, with their
defects: at the apex ``up`` and ``down`` agree only when the peak is y_max exactly, and equation 3 overshoots.
"""

from __future__ import annotations

import math

Y_MAX = 0.3
"""m: the largest foot height."""
Z_MAX = 0.6
"""m: the step's length at it."""
LEG = 0.8
"""m: of the paper's avatar."""


def phase_angle(h: float) -> float:
    """phi, rad in [0, pi/2], of a foot height in m."""
    return 2.0 * math.pi * min(max(h, 0.0), Y_MAX) / (4.0 * Y_MAX)


def first_step(h: float, *, up: bool) -> tuple[float, float]:
    """Equations 1 and 2: z of the stepping and of the supporting foot, m."""
    cosine = math.cos(phase_angle(h))
    z = Z_MAX / 4.0 * (1.0 - cosine if up else 1.0 + cosine)
    return z, -z


def next_step(h: float, *, up: bool) -> tuple[float, float]:
    """Equations 3 and 4: z of the stepping and of the supporting foot, m."""
    phi = phase_angle(h)
    half = Z_MAX / 2.0 * math.cos(phi)
    if up:
        return -half, half
    return half + Z_MAX / 4.0 * math.sin(2.0 * phi), -half


def body_drop(z_trailing: float) -> float:
    """Equation 5: by how much the body comes down, m."""
    z = min(abs(z_trailing), LEG)
    return LEG - math.sqrt(LEG * LEG - z * z)


def body_height(standing: float, drop: float, *, stopped: bool) -> float:
    """Equations 6 and 7, m."""
    return standing if stopped else standing - drop


def foot_heights(h: float, drop: float) -> tuple[float, float]:
    """Equation 8: y of the stepping and of the supporting foot above the body's own lowered floor, m."""
    return h / 2.0 + drop, drop
