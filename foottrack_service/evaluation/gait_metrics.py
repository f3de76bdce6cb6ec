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
_PICTURE_S = 1.0 / 90.0


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
    """What of a target's move in each output frame its motion does not explain, m, (n - 1,).

    ``t`` (n,) s, ``p`` (n, k) m. A frame's pace is predicted, per axis, by straight lines through the two frames before
    it, the two after it and the two beside it, and by the cubic through all four. What lies between the predictions is
    explained; what lies beyond, times the frame, is the jump. The lines are exact for steady acceleration, and differ
    where the pace breaks, as when a foot lands: a break explains any pace between. A jump of J between two frames adds
    J / dt to one pace and to no prediction, so it gives J, less what the predictions differ by: for motion of largest
    pace V and angular frequency w V (w dt)^2 dt, 1.8 mm of the fastest swing (4 m/s, 0.3 s, 100 Hz), which itself gives
    nothing. (A bound on the pace alone would let 40 mm pass.)

    An engine that draws 90 pictures a second sees what happens within 11 ms as one frame: faster outputs are looked at
    so as well, and a frame has the larger figure of both.
    """
    kept = np.flatnonzero(np.concatenate([[True], np.diff(t) > _LEAST_FRAME_S]))
    found = np.zeros(max(0, len(t) - 1))
    if len(kept) < 6:
        return found
    every = max(1, round(_PICTURE_S / float(np.median(np.diff(t[kept])))))
    for step in {1, every}:
        for first in range(step):
            at = kept[first::step]
            if len(at) > 5:
                beyond = _unexplained(t[at], p[at])
                # Of several outputs in one picture, the last has it.
                np.maximum.at(found, at[1:] - 1, beyond)
    return found


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


def _unexplained(t: Array, p: Array) -> Array:
    dt = np.diff(t)
    pace, middle = np.diff(p, axis=0) / dt[:, None], 0.5 * (t[1:] + t[:-1])
    now = middle[2:-2]
    around = [(middle[k : len(middle) - 4 + k], pace[k : len(pace) - 4 + k]) for k in (0, 1, 3, 4)]
    predicted = np.stack([_extended(now, chosen) for chosen in (around[:2], around[1:3], around[2:], around)])
    actual = pace[2:-2]
    beyond = np.maximum(predicted.min(axis=0) - actual, actual - predicted.max(axis=0))
    found = np.zeros(len(pace))
    found[2:-2] = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) * dt[2:-2]
    return found


def _extended(at: Array, known: list[tuple[Array, Array]]) -> Array:
    """Lagrange's polynomial through known (time, value), (n,) and (n, k), at other times (n,)."""
    total = np.zeros_like(known[0][1])
    for i, (time, value) in enumerate(known):
        weight = np.ones_like(at)
        for j, (other, _) in enumerate(known):
            if i != j:
                weight = weight * (at - other) / (time - other)
        total += weight[:, None] * value
    return total


def _pearson(a: Array, b: Array) -> float:
    if np.std(a) < 1e-9:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
