"""Smooth curves through keys: periodic ones over the cycle, and ones that start and end at rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BPoly, BSpline, CubicSpline

from foottrack_service import rotations as rot

Array = npt.NDArray[np.float64]
Curve = Callable[[Array], Array]

_DENSE = 1.0 / 12.0
"""Cycles from key to key, on average, that are close enough for the curve of least jerk."""
_NEAR = 1e-4
"""What a jerk of one unit per span cubed weighs against one unit (m or rad) of distance from a key."""


def periodic(phases: Array, values: Array) -> Curve:
    """Twice continuously differentiable curve of period 1 through values (k, ...) at increasing phases (k,)."""
    spline = CubicSpline(np.append(phases, phases[0] + 1.0), np.concatenate([values, values[:1]]), bc_type="periodic")
    start = phases[0]
    return lambda phase: np.asarray(spline(start + np.mod(phase - start, 1.0)))


def periodic_rotation(phases: Array, quaternions: Array) -> Curve:
    """The same for quaternions (k, 4): splined by component, then made unit.

    Right for keys less than 90 degrees apart, which neighbouring key poses are.
    """
    closed = rot.continuous(np.concatenate([quaternions, quaternions[:1]]))
    if np.dot(closed[-1], closed[0]) < 0.0:
        raise ValueError("a joint turns a full circle within one cycle")
    curve = periodic(phases, closed[:-1])
    return lambda phase: rot.normalised(curve(phase))


def at_rest(phases: Array, values: Array) -> Curve:
    """Curve through values (k, ...) with zero first and second derivative at both ends, and twice continuously
    differentiable; constant outside.

    Where the keys are dense it is the one of least jerk, as people move (Flash and Hogan 1985). Through the few keys of
    a textbook that one would overshoot by half: there slopes are limited.
    """
    dense = float(phases[-1] - phases[0]) <= _DENSE * (len(phases) - 1)
    return _least_jerk(phases, values) if dense else _limited(phases, values)


def smooth_step(share: npt.ArrayLike) -> Array:
    """0 to 1 with zero first and second derivative at both ends (Perlin's quintic)."""
    u = np.clip(np.asarray(share, dtype=np.float64), 0.0, 1.0)
    return np.asarray(u * u * u * (u * (6.0 * u - 15.0) + 10.0))


def soft_minimum(a: Array, b: Array, width: float) -> Array:
    """Never above either, smooth, at most `width` below the lesser."""
    return np.asarray(0.5 * (a + b - np.sqrt((a - b) ** 2 + 4.0 * width * width)))


def _least_jerk(phases: Array, values: Array) -> Curve:
    """A quintic spline whose least squares weigh its jerk against the distance from the inner values."""
    first, span = float(phases[0]), float(phases[-1] - phases[0])
    pieces = 2 * len(phases)
    knots = np.concatenate([np.zeros(5), np.linspace(0.0, 1.0, pieces + 1), np.ones(5)])
    basis = BSpline(knots, np.eye(pieces + 5), 5)
    grid = (np.arange(4 * pieces) + 0.5) / (4 * pieces)
    rows = np.concatenate([_NEAR * basis(grid, 3) / np.sqrt(len(grid)), basis((phases[1:-1] - first) / span)])
    goal = np.concatenate([np.zeros((len(grid), values[0].size)), values[1:-1].reshape(len(phases) - 2, -1)])
    # Three equal coefficients at an end of a clamped quintic are its value, at rest.
    c = np.repeat(values[[0, -1]].reshape(2, -1), [3, pieces + 2], axis=0)
    c[3:-3] = np.linalg.lstsq(rows[:, 3:-3], goal - rows[:, :3] @ c[:3] - rows[:, -3:] @ c[-3:], rcond=None)[0]
    curve = BSpline(knots, c.reshape(-1, *values.shape[1:]), 5)
    return lambda phase: np.asarray(curve(np.clip((phase - first) / span, 0.0, 1.0)))


def _limited(phases: Array, values: Array) -> Curve:
    """Quintic pieces whose slopes are the cubic spline's, kept within twice the lesser rise on either side (so that the
    curve neither overshoots nor flattens at every key), and whose second derivatives are the mean of the cubic's on
    either side."""
    step = np.diff(phases).reshape(-1, *[1] * (values.ndim - 1))
    rise = np.diff(values, axis=0) / step
    slopes = CubicSpline(phases, values, bc_type="clamped")(phases, 1)
    before, after = rise[:-1], rise[1:]
    most = np.minimum(np.abs(before), np.abs(after)) * np.where(before * after > 0.0, 2.0, 0.5)
    slopes[1:-1] = np.clip(slopes[1:-1], -most, most)
    leaving = (6.0 * rise - 4.0 * slopes[:-1] - 2.0 * slopes[1:]) / step
    arriving = (-6.0 * rise + 2.0 * slopes[:-1] + 4.0 * slopes[1:]) / step
    bends = np.zeros_like(values)
    bends[1:-1] = 0.5 * (arriving[:-1] + leaving[1:])
    pieces = BPoly.from_derivatives(phases, np.stack([values, slopes, bends], axis=1))
    return lambda phase: np.asarray(pieces(np.clip(phase, phases[0], phases[-1])))
