"""When: phase as a function of time. It advances with distance, so that nothing slips while the walk speeds up."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

Array = npt.NDArray[np.float64]

_RAMP_CYCLES = 0.45
"""Cycles of walking that setting off and stopping take (they last twice that in time)."""


@dataclass(frozen=True)
class Clock:
    """`phase(t)` for t in [0, duration] s, and its inverse `time(phase)`; both monotone, shapes (n,)."""

    duration: float
    start: float
    end: float
    _rate: PchipInterpolator
    _travelled: PchipInterpolator

    def phase(self, time: npt.ArrayLike) -> Array:
        t = np.clip(np.asarray(time, dtype=np.float64), 0.0, self.duration)
        return np.asarray(np.minimum(self.start + self._travelled(t), self.end))

    def rate(self, time: npt.ArrayLike) -> Array:
        """Cycles per second."""
        t = np.clip(np.asarray(time, dtype=np.float64), 0.0, self.duration)
        return np.asarray(np.maximum(self._rate(t), 0.0))

    def time(self, phase: npt.ArrayLike) -> Array:
        """When a phase is reached, s; 0 for phases before the start, the duration for those after the end."""
        goal = np.clip(np.asarray(phase, dtype=np.float64), self.start, self.end)
        low, high = np.zeros_like(goal), np.full_like(goal, self.duration)
        # 60 halvings take any walk below a femtosecond, and need no derivative where the rate is zero.
        for _ in range(60):
            middle = 0.5 * (low + high)
            early = self.phase(middle) < goal
            low, high = np.where(early, middle, low), np.where(early, high, middle)
        return np.asarray(0.5 * (low + high))


def make_clock(
    start: float,
    end: float,
    period: float,
    *,
    from_rest: bool,
    to_rest: bool,
    speeds: list[tuple[float, float]] | None = None,
) -> Clock:
    """The clock of a walk from phase `start` to `end` at 1 / period, in cycles.

    `speeds` are (share of the walk in [0, 1], factor) and change the rate smoothly in between. Raises ValueError
    for shares or factors out of range.
    """
    total = end - start
    shares, factors = [0.0, 1.0], [1.0, 1.0]
    if speeds:
        ordered = sorted(speeds)
        shares, factors = [s for s, _ in ordered], [f for _, f in ordered]
        if shares[0] < 0.0 or shares[-1] > 1.0 or len(set(shares)) != len(shares):
            raise ValueError("speeds: the shares of the walk must differ and lie in [0, 1]")
        if not all(0.1 <= f <= 4.0 for f in factors):
            raise ValueError("speeds: factors must be 0.1 to 4")
        if shares[0] > 0.0:
            shares, factors = [0.0, *shares], [factors[0], *factors]
        if shares[-1] < 1.0:
            shares, factors = [*shares, 1.0], [*factors, factors[-1]]
    ramp = min(_RAMP_CYCLES, 0.3 * total)
    knots = max(65, 8 * math.ceil(total) + 1)
    steady = np.linspace(start + ramp * from_rest, end - ramp * to_rest, knots)
    rates = PchipInterpolator(np.array(shares) * total + start, factors)(steady) / period
    # Trapezoids: exact for a rate that is linear in time between knots.
    gaps = np.diff(steady) / (0.5 * (rates[1:] + rates[:-1]))
    lead_in = 2.0 * ramp / rates[0] if from_rest else 0.0
    lead_out = 2.0 * ramp / rates[-1] if to_rest else 0.0
    times = lead_in + np.concatenate([[0.0], np.cumsum(gaps)])
    if from_rest:
        times, rates = np.concatenate([[0.0], times]), np.concatenate([[0.0], rates])
    if to_rest:
        times, rates = np.append(times, times[-1] + lead_out), np.append(rates, 0.0)
    covered = float(PchipInterpolator(times, rates).antiderivative()(times[-1]))
    # What the smooth curve covers differs a little from the trapezoids: stretch time, so that it ends at `end`.
    stretch = total / covered
    times = times * stretch
    rate = PchipInterpolator(times, rates)
    return Clock(float(times[-1]), start, end, rate, rate.antiderivative())
