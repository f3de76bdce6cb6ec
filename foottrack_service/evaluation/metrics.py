"""Figures of merit of a track against its truth. Each is tested on signals with known answers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from foottrack_service.evaluation.truth import Flags
from foottrack_service.rotations import Array

LONGEST_LAG_S = 0.5
_LAG_STEP_S = 0.001
FRAME_HZ = 90.0
"""Rate of an engine's frames, for what moves from frame to frame."""


def lag_s(seconds: Array, estimate: Array, truth_at: Callable[[Array], Array]) -> float | None:
    """By how much an estimate is late: the shift of the truth that fits it best, s. Nil when nothing moves.

    ``seconds`` (n,), ``estimate`` (n, 3) in m; ``truth_at`` gives the true track at any seconds. A constant offset
    between the two does not count. Positive is late; searched from -0.1 to 0.5 s in steps of 1 ms, then refined by
    the parabola through the best three.
    """
    if len(seconds) < 20 or np.max(np.ptp(truth_at(seconds), axis=0)) < 0.02:
        return None
    shifts = np.arange(-0.1, LONGEST_LAG_S + _LAG_STEP_S / 2, _LAG_STEP_S)

    def misfit(shift: float) -> float:
        return float(np.var(estimate - truth_at(seconds - shift), axis=0).sum())

    coarse = shifts[::10]
    about = coarse[int(np.argmin([misfit(shift) for shift in coarse]))]
    fine = shifts[(shifts >= about - 0.01) & (shifts <= about + 0.01)]
    costs = np.array([misfit(shift) for shift in fine])
    best = int(np.argmin(costs))
    if 0 < best < len(fine) - 1:
        before, at, after = costs[best - 1 : best + 2]
        bend = before - 2.0 * at + after
        return float(fine[best] + (0.5 * _LAG_STEP_S * (before - after) / bend if bend > 0.0 else 0.0))
    return float(fine[best])


def peak_delay_s(seconds: Array, errors: Array, onset_s: float) -> float | None:
    """[B]'s own "latency": from the onset of a sudden move to the largest error, s."""
    after = seconds >= onset_s
    if not np.any(after):
        return None
    return float(seconds[after][int(np.argmax(errors[after]))] - onset_s)


def jitter_m(estimate: Array, truth: Array) -> tuple[float, float] | None:
    """Noise of a foot that stands, m: rms distance from the mean error, and rms change from one row to the next.

    Rows (n, 3) at the frame rate. White noise of s per axis gives s sqrt(3) and s sqrt(6).
    """
    if len(estimate) < 10:
        return None
    error = estimate - truth
    around = error - error.mean(axis=0)
    steps = np.diff(error, axis=0)
    return float(np.sqrt(np.mean(np.sum(around**2, axis=1)))), float(np.sqrt(np.mean(np.sum(steps**2, axis=1))))


def skate_m(estimate: Array, planted: Flags) -> list[float]:
    """Per stance, how far a planted foot wanders over the floor: the largest distance from where it was first, m.

    ``estimate`` (n, 3), ``planted`` (n,) whether the true foot stands flat.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], planted, [False]]).astype(int)))
    wander = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        track = estimate[begin:end][:, [0, 2]]
        if len(track) >= 5:
            wander.append(float(np.max(np.linalg.norm(track - track[0], axis=1))))
    return wander


def within_sigma(errors: Array, sigma: Array) -> dict[str, float]:
    """Shares of errors within 1, 2 and 3 times the announced radius of 68 %."""
    if len(errors) == 0:
        return {}
    return {str(times): round(float(np.mean(errors <= times * sigma)), 4) for times in (1, 2, 3)}
