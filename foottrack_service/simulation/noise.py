"""Random processes that several models share. All draw from the generator that they are given."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, lfilter, sosfiltfilt

from foottrack_service.rotations import Array


def gauss_markov(random: np.random.Generator, count: int, step: float, tau: float, sd: Array | float) -> Array:
    """First-order Gauss-Markov process with standard deviation `sd` (scalar or (3,)) and time constant `tau` s.

    Sampled `count` times, `step` s apart; shape (count, 3). It starts in its stationary state.
    """
    decay = np.exp(-step / tau)
    drive = random.standard_normal((count, 3))
    drive[1:] *= np.sqrt(1.0 - decay**2)
    walk: Array = lfilter([1.0], [1.0, -decay], drive, axis=0)
    return walk * sd


def smooth_gauss_markov(
    random: np.random.Generator, count: int, step: float, tau: float, smooth_tau: float, sd: float
) -> Array:
    """As ``gauss_markov``, through a first-order low-pass of `smooth_tau` s, with the same standard deviation."""
    rough = gauss_markov(random, count, step, tau, sd * np.sqrt(1.0 + smooth_tau / tau))
    keep = np.exp(-step / smooth_tau)
    smooth: Array = lfilter([1.0 - keep], [1.0, -keep], rough, axis=0, zi=keep * rough[:1])[0]
    return smooth


def wander(random: np.random.Generator, count: int, rate: float, band_hz: float, sd: Array | float) -> Array:
    """Smooth random motion below `band_hz` with standard deviation `sd` (scalar or (3,)); (count, 3) at `rate` Hz."""
    # Drawn slowly and then interpolated: filtering far below the sampling rate is ill-conditioned.
    slow = 8.0 * band_hz
    sections = butter(4, band_hz, fs=slow, output="sos")
    length = int(np.ceil(count * slow / rate)) + 64
    drawn = sosfiltfilt(sections, random.standard_normal((length, 3)), axis=0)
    drawn *= np.sqrt(slow / (2.0 * band_hz) / _POWER_KEPT)
    spline = make_interp_spline((np.arange(length) - 32) / slow, drawn, k=5)
    smooth: Array = spline(np.arange(count) / rate)
    return smooth * sd


_POWER_KEPT = 0.88
"""Share of the band's power that a Butterworth filter of order 4, run both ways, leaves below its edge."""
