"""Allan deviation of a sensor that lies still, and the five noises in it.

Overlapping Allan variance and the noise model of IEEE Std 952-1997, annex C:
``3 Q^2 / tau^2 + N^2 / tau + (2 ln 2 / pi) B^2 + K^2 tau / 3 + R^2 tau^2 / 2``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEAST_SAMPLES = 1000
TAUS_PER_DECADE = 12
LONGEST_SHARE = 1.0 / 9.0
"""Of the recording: longer averages have too few neighbours to say anything."""

_REWEIGHTINGS = 5


class TooShort(ValueError):
    """The recording has not enough samples."""


@dataclass(frozen=True)
class AllanNoise:
    """Coefficients, with u the unit of the signal (rad/s or m/s^2); zero where a noise does not show."""

    quantisation: float
    """Q, u s."""
    random_walk: float
    """N, u / sqrt(Hz): of the angle (gyro) or the velocity (accelerometer). What data sheets call noise density."""
    bias_instability: float
    """B, u."""
    rate_random_walk: float
    """K, u / sqrt(s)."""
    ramp: float
    """R, u / s."""

    def deviation(self, tau: npt.ArrayLike) -> Array:
        """The model's Allan deviation at tau (s), shape (n,), u."""
        squares = np.array(
            [
                self.quantisation**2,
                self.random_walk**2,
                self.bias_instability**2,
                self.rate_random_walk**2,
                self.ramp**2,
            ]
        )
        return np.asarray(np.sqrt(_terms(np.asarray(tau, dtype=np.float64)) @ squares))


@dataclass(frozen=True)
class AllanCurve:
    """Allan deviation [u] of one axis at averaging times tau [s], shape (n,), and how many samples it is of."""

    tau: Array
    deviation: Array
    samples: int
    period_s: float


def allan_curve(signal: npt.ArrayLike, period_s: float) -> AllanCurve:
    """Of equidistant samples, shape (n,), with all overlapping averages. Raises TooShort, and ValueError for NaN."""
    x = np.asarray(signal, dtype=np.float64)
    if len(x) < LEAST_SAMPLES:
        raise TooShort(f"{len(x)} samples, at least {LEAST_SAMPLES} are needed")
    if not (np.all(np.isfinite(x)) and period_s > 0.0):
        raise ValueError("the signal or its period is not finite")
    # Without its mean, or hours of gravity would eat the last digits.
    theta = np.concatenate([[0.0], np.cumsum(x - x.mean())]) * period_s
    longest = int(len(x) * LONGEST_SHARE)
    count = int(math.log10(longest) * TAUS_PER_DECADE) + 1
    sizes = np.unique(np.round(np.logspace(0.0, math.log10(longest), count)).astype(int))
    variances = []
    for m in sizes:
        second = theta[2 * m :] - 2.0 * theta[m:-m] + theta[: -2 * m]
        variances.append(np.mean(second**2) / (2.0 * (m * period_s) ** 2))
    return AllanCurve(sizes * period_s, np.sqrt(np.array(variances)), len(x), period_s)


def fit_noise(curve: AllanCurve) -> AllanNoise:
    """The five coefficients: non-negative least squares on the variance, each tau weighted by what it can know.

    The weights come from the fit itself (a curve's own accidents must not weigh), hence the repetition.
    """
    from scipy.optimize import nnls

    variance = curve.deviation**2
    if not np.any(variance > 0.0):
        return AllanNoise(0.0, 0.0, 0.0, 0.0, 0.0)
    terms = _terms(curve.tau)
    # About as many independent pairs of averages as fit side by side.
    pairs = np.maximum(curve.samples * curve.period_s / curve.tau - 1.0, 1.0)
    model = np.maximum(variance, variance.max() * 1e-12)
    squares = np.zeros(5)
    for _ in range(_REWEIGHTINGS):
        weight = np.sqrt(pairs) / model
        # Columns of equal length: the coefficients differ by many powers of ten.
        scale = np.linalg.norm(terms * weight[:, None], axis=0)
        squares = nnls(terms * weight[:, None] / scale, variance * weight)[0] / scale
        model = np.maximum(terms @ squares, variance.max() * 1e-12)
    q, n, b, k, r = (float(value) for value in np.sqrt(squares))
    return AllanNoise(q, n, b, k, r)


def _terms(tau: Array) -> Array:
    """What each squared coefficient adds to the variance, shape (n, 5)."""
    return np.stack(
        [3.0 / tau**2, 1.0 / tau, np.full_like(tau, 2.0 * math.log(2.0) / math.pi), tau / 3.0, tau**2 / 2.0], axis=1
    )
