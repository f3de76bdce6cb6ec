"""A long recording of a sensor that lay still, made fit for an Allan deviation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEAST_S = 60.0
MAX_MISSING_SHARE = 0.01
MAX_ACC_STEP = 0.5
"""m/s^2, of a second's mean from the recording's: somebody touched it."""
MAX_GYRO_STEP = 0.05
"""rad/s."""


class NotStill(ValueError):
    """The recording does not serve; the text says why."""


@dataclass(frozen=True)
class StillRecording:
    """Equidistant samples: specific force [m/s^2] and, where there is a gyro, rate [rad/s], shape (n, 3)."""

    period_s: float
    acc: Array
    gyro: Array | None
    missing: int
    """Samples that were lost, and interpolated."""


def still_recording(t: npt.ArrayLike, acc: npt.ArrayLike, gyro: npt.ArrayLike | None) -> StillRecording:
    """From stamps [s], shape (n,), and samples, shape (n, 3). Raises NotStill: too short, moved, or too many lost."""
    t, acc = np.asarray(t, dtype=np.float64), np.asarray(acc, dtype=np.float64)
    seconds = float(t[-1] - t[0]) if len(t) > 1 else 0.0
    if seconds < LEAST_S:
        raise NotStill(f"{seconds:.0f} s of samples, at least {LEAST_S:.0f} are needed, and an hour is better")
    steps = np.diff(t)
    # Samples that came in one datagram have one stamp.
    usual = float(np.median(steps[steps > 0.0]))
    lost = np.where(steps > 1.5 * usual, np.round(steps / usual) - 1.0, 0.0)
    missing = int(lost.sum())
    if missing > MAX_MISSING_SHARE * len(t):
        raise NotStill(f"{missing} of {len(t) + missing} samples are missing, too many to close the gaps")
    places = np.concatenate([[0.0], np.cumsum(1.0 + lost)])
    period_s = seconds / places[-1]
    acc = _filled(places, acc)
    _check_still(acc, period_s, MAX_ACC_STEP, "m/s^2")
    if gyro is not None:
        gyro = _filled(places, np.asarray(gyro, dtype=np.float64))
        _check_still(gyro, period_s, MAX_GYRO_STEP, "rad/s")
    return StillRecording(period_s, acc, gyro, missing)


def _filled(places: Array, samples: Array) -> Array:
    every = np.arange(int(places[-1]) + 1)
    return np.stack([np.interp(every, places, samples[:, axis]) for axis in range(3)], axis=1)


def _check_still(samples: Array, period_s: float, limit: float, unit: str) -> None:
    block = max(1, round(1.0 / period_s))
    count = len(samples) // block
    means = samples[: count * block].reshape(count, block, 3).mean(axis=1)
    away = np.linalg.norm(means - np.median(means, axis=0), axis=1)
    moved = np.flatnonzero(~(away <= limit))
    if len(moved):
        raise NotStill(f"it moved {moved[0]} s after the beginning, by {away[moved[0]]:.2g} {unit}: cut that off")
