"""Where a foot went, by its IMU alone: from standing, one step, to standing again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.rotations import Array

Flags = npt.NDArray[np.bool_]

WINDOW_S = 0.15
REST_SPREAD = 0.5
"""m/s^2 of specific force within a window, of a foot that stands."""


class Sample(NamedTuple):
    """One sample: stamp [s], specific force [m/s^2, sensor frame], sensor to the device's own gravity-aligned frame."""

    t: float
    acc: Sequence[float]
    q: Sequence[float]


def resting(samples: Sequence[Sample]) -> Flags:
    """(n,) whether the foot stands around each sample."""
    t = np.array([s.t for s in samples])
    acc = np.array([s.acc for s in samples])
    begin = np.searchsorted(t, t - 0.5 * WINDOW_S)
    end = np.searchsorted(t, t + 0.5 * WINDOW_S, side="right")
    # Spread by running sums: mean of squares less square of the mean.
    sums = np.concatenate([np.zeros((1, 6)), np.cumsum(np.hstack([acc, acc * acc]), axis=0)])
    mean = (sums[end] - sums[begin]) / (end - begin)[:, None]
    variance = np.maximum(mean[:, 3:] - mean[:, :3] ** 2, 0.0).sum(axis=1)
    return np.asarray(variance < REST_SPREAD**2)


def displacement(samples: Sequence[Sample]) -> Array:
    """Way of the sensor in the device's frame, (3,) m. Each movement begins and ends at rest, without drift."""
    t = np.array([s.t for s in samples])
    acc = rot.rotate(np.array([s.q for s in samples]), np.array([s.acc for s in samples]))
    # What the sensor reads at rest is gravity and its bias, whatever its scale.
    rests = resting(samples)
    gravity = acc[rests].mean(axis=0) if rests.any() else np.array([0.0, STANDARD_GRAVITY, 0.0])
    edges = np.flatnonzero(np.diff(np.concatenate([[True], rests, [True]]).astype(int)))
    way = np.zeros(3)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        # With the rest on either side, as far as there is one.
        part = slice(max(begin - 1, 0), min(end + 1, len(t)))
        way += _moved(t[part], acc[part] - gravity)
    return way


def _moved(t: Array, acc: Array) -> Array:
    dt = np.diff(t)[:, None]
    v = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (acc[1:] + acc[:-1]) * dt, axis=0)])
    span = t[-1] - t[0]
    if span <= 0.0:
        return np.zeros(3)
    v -= ((t - t[0]) / span)[:, None] * v[-1]
    return np.asarray(np.sum(0.5 * (v[1:] + v[:-1]) * dt, axis=0))
