"""Figures of merit of a gait and of an avatar's feet. Each is tested on signals with known answers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foottrack_service.evaluation.truth import Flags
from foottrack_service.rotations import Array

TOLERANCE_S = 0.3
"""A found instant further from every true one is an extra one."""
PLANTED_M = 0.004
"""An avatar's foot that is not higher above its standing height stands on the floor."""
_LONGEST_LAG_S = 0.25
_LAG_GRID_S = 0.005
_LEAST_FRAME_S = 0.0015


class Matched(NamedTuple):
    """True instants and what was found of them."""

    true: int
    errors: Array
    """Found minus true of those that were found, s."""
    extra: int

    @property
    def found(self) -> int:
        """How many were found."""
        return len(self.errors)


def match(true: Array, found: Array, tolerance: float = TOLERANCE_S) -> Matched:
    """Pair instants (s), the nearest first, each used once."""
    gaps = np.abs(np.asarray(found)[None, :] - np.asarray(true)[:, None]) if len(true) and len(found) else None
    errors: list[float] = []
    while gaps is not None and float(np.min(gaps)) <= tolerance:
        i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
        errors.append(float(found[j] - true[i]))
        gaps[i, :], gaps[:, j] = np.inf, np.inf
    return Matched(len(true), np.array(errors), len(found) - len(errors))


def jumps_m(t: Array, p: Array) -> Array:
    """How far a target's move in one output frame is from any pace between those of the frames beside it, m, (n - 1,).

    ``t`` (n,) s, ``p`` (n, k) m. Steady motion and changes of pace give 0; a jump gives its own length.
    """
    keep = np.concatenate([[True], np.diff(t) > _LEAST_FRAME_S])
    t, p = t[keep], p[keep]
    if len(t) < 4:
        return np.zeros(max(0, len(t) - 1))
    dt = np.diff(t)
    pace = np.diff(p, axis=0) / dt[:, None]
    before, now, after = pace[:-2], pace[1:-1], pace[2:]
    change = after - before
    length2 = np.sum(change * change, axis=1)
    share = np.sum((now - before) * change, axis=1) / np.where(length2 > 0.0, length2, 1.0)
    nearest = before + np.clip(share, 0.0, 1.0)[:, None] * change
    beyond = np.zeros(len(pace))
    beyond[1:-1] = np.linalg.norm(now - nearest, axis=1) * dt[1:-1]
    return beyond


def skates_m(t: Array, z: Array, y: Array, speed: Array, planted: Flags) -> list[float]:
    """Per stance, the range over which a planted target moves in a world in which the avatar goes at ``speed``, m.

    ``z`` (n,) m before the hips, ``y`` (n,) m above standing, ``planted`` (n,) whether the user's foot stands. The
    avatar's foot stands when both its own height and the user's foot say so.
    """
    world = np.concatenate([[0.0], np.cumsum(speed[1:] * np.diff(t))]) + z
    down = planted & (y < PLANTED_M)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], down, [False]]).astype(int)))
    return [
        float(np.ptp(world[begin:end])) for begin, end in zip(edges[::2], edges[1::2], strict=True) if end - begin > 4
    ]


def correlation_and_lag(t: Array, avatar: Array, user: Array) -> tuple[float, float] | None:
    """How well two heights go together: Pearson's r at no lag, and the lag of the best r, s (positive: avatar late).

    (n,) each; None when one of them does not move. Searched within 0.25 s.
    """
    if len(t) < 20:
        return None
    grid = np.arange(t[0], t[-1], _LAG_GRID_S)
    a, u = np.interp(grid, t, avatar), np.interp(grid, t, user)
    reach = round(_LONGEST_LAG_S / _LAG_GRID_S)
    if len(grid) < 4 * reach or np.std(a) < 1e-4 or np.std(u) < 1e-4:
        return None
    middle = u[reach:-reach]
    scores = np.array(
        [_pearson(a[reach + shift : len(a) - reach + shift], middle) for shift in range(-reach, reach + 1)]
    )
    best = int(np.argmax(scores))
    offset = 0.0
    if 0 < best < len(scores) - 1:
        before, at, after = scores[best - 1 : best + 2]
        bend = before - 2.0 * at + after
        offset = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(scores[reach]), float((best - reach + offset) * _LAG_GRID_S)


def _pearson(a: Array, b: Array) -> float:
    if np.std(a) < 1e-9:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
