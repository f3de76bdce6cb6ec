"""How healthy people walk: published joint angles over the cycle, and the band they lie in.

M. H. Schwartz, A. Rozumalski, J. P. Trost, "The effect of walking speed on the gait of typically developing
children", Journal of Biomechanics 41 (2008) 1639-1650: sagittal angles at the self-chosen speed, mean and one
standard deviation, every 2 % of the cycle from foot contact. Children, whose angles are an adult's; hip flexion is
against the pelvis and so holds its forward tilt of about 12 degrees.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]

ANGLES: Final = ("hip", "knee", "ankle")
PELVIC_TILT_DEG: Final = 12.0
"""What the published hip angle holds of the pelvis' own tilt; our pelvis has none in its rest pose."""

# fmt: off
_MEAN_DEG: Final = {
    "hip": (
        35.8, 35.7, 35.5, 35.1, 34.2, 32.8, 31.1, 29.1, 26.9, 24.7, 22.5, 20.3, 18.1, 15.8, 13.6, 11.4,
        9.3, 7.3, 5.3, 3.4, 1.6, -0.1, -1.7, -3.2, -4.4, -5.3, -5.8, -5.7, -4.9, -3.4, -0.9, 2.3, 6.1,
        10.1, 14.1, 17.9, 21.4, 24.6, 27.4, 29.9, 32, 33.7, 35.1, 36, 36.6, 36.7, 36.5, 36.2, 35.8,
        35.6,
    ),
    "knee": (
        5.6, 7.9, 10.9, 14.1, 16.9, 18.6, 19.3, 19.2, 18.6, 17.6, 16.5, 15.2, 13.9, 12.6, 11.3, 10.1, 9,
        8, 7.2, 6.6, 6.2, 6.3, 6.8, 7.9, 9.5, 11.6, 14.5, 18.1, 22.6, 27.9, 33.9, 40.2, 46.3, 51.7,
        55.7, 58.2, 59.1, 58.7, 56.9, 53.9, 49.8, 44.7, 38.8, 32.4, 25.5, 18.7, 12.5, 7.6, 4.6, 4,
    ),
    "ankle": (
        -2.1, -3.9, -5.6, -5.6, -4.1, -2.1, -0.2, 1.5, 2.9, 4.1, 5.2, 6.1, 6.8, 7.4, 8, 8.6, 9.1, 9.7,
        10.2, 10.7, 11.1, 11.5, 11.8, 11.8, 11.5, 10.4, 8.4, 4.9, -0.2, -6.9, -13.8, -18.5, -19.8, -18,
        -14.7, -11.2, -7.9, -4.9, -2.4, -0.3, 1.1, 2.1, 2.5, 2.4, 1.8, 1, 0.1, -0.6, -1.1, -1.4,
    ),
}
_SD_DEG: Final = {
    "hip": (
        5.4, 5.5, 5.6, 5.8, 5.9, 6, 6, 6, 6, 6, 6, 6, 5.9, 5.9, 6, 6, 6.1, 6.3, 6.4, 6.6, 6.7, 6.8, 6.8,
        6.8, 6.8, 6.8, 6.8, 6.8, 6.7, 6.8, 6.8, 6.7, 6.6, 6.5, 6.3, 6.2, 6, 5.9, 5.7, 5.6, 5.5, 5.4,
        5.4, 5.4, 5.4, 5.5, 5.5, 5.5, 5.5, 5.5,
    ),
    "knee": (
        5.7, 5.5, 5.6, 5.8, 6.1, 6.3, 6.3, 6.3, 6.2, 6.1, 5.9, 5.8, 5.7, 5.6, 5.5, 5.5, 5.5, 5.6, 5.7,
        5.7, 5.7, 5.7, 5.7, 5.7, 5.6, 5.7, 5.8, 5.9, 6.2, 6.4, 6.6, 6.6, 6.4, 6, 5.7, 5.6, 5.9, 6.3,
        6.8, 7.4, 7.8, 8.2, 8.5, 8.7, 8.7, 8.5, 8.1, 7.4, 6.6, 6,
    ),
    "ankle": (
        5.6, 5.2, 4.8, 4.3, 4, 4, 4, 4, 4, 3.9, 3.8, 3.7, 3.7, 3.7, 3.8, 3.8, 3.9, 4, 4.1, 4.3, 4.4,
        4.5, 4.7, 4.9, 5.2, 5.6, 6.2, 7.2, 8.3, 9.3, 9.5, 9.1, 8.8, 8.7, 8.2, 7.5, 6.8, 6.2, 5.7, 5.3,
        4.9, 4.5, 4.2, 4.1, 4.1, 4.4, 4.7, 5.1, 5.3, 5.5,
    ),
}
# fmt: on


def normative_mean(angle: str, phase: npt.ArrayLike) -> Array:
    """Mean of "hip", "knee" (flexion positive) or "ankle" (dorsiflexion positive), degrees, at phases (n,) since
    the foot's own strike."""
    return _periodic(_MEAN_DEG[angle], phase)


def normative_sd(angle: str, phase: npt.ArrayLike) -> Array:
    """One standard deviation of the same, degrees."""
    return _periodic(_SD_DEG[angle], phase)


def _periodic(values: tuple[float, ...], phase: npt.ArrayLike) -> Array:
    spline = CubicSpline(np.linspace(0.0, 1.0, len(values) + 1), [*values, values[0]], bc_type="periodic")
    return np.asarray(spline(np.mod(phase, 1.0)))
