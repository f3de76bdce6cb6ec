"""Whose tag it is, by how it moves: one that moves while its foot stands, as the other foot does, is the other's.

Places cannot tell two feet apart for long that were swapped: each of them has another place then, or none. But seldom
do both feet stand, or swing, at once: a few pictures of a walk show which of the two IMUs a tag belongs to.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from foottrack_service.fusion.foot_filter_events import GYRO, IMU, KIND, ZERO_SIGMA
from foottrack_service.fusion.interface import Kind, Moves
from foottrack_service.fusion.timeline import Timeline
from foottrack_service.rotations import Array

LEAST_SPAN_S, SPAN_S = 0.045, 0.12
"""A tag's motion is looked at over this."""
STILL, MOVING = 0.008, 0.03
"""m, beyond two sigma: a tag that moved by less stood, and by more did not."""
FASTEST = 8.0
"""m/s: what goes further from one picture to the next is another thing."""
SWINGS = 1.0
"""rad/s rms: a foot that is not quiet swings when it turns so fast."""
LONGEST_PICTURE_S = 0.05
"""For more than this no picture counts."""
SURE_S, MOST_S = 0.06, 0.2
"""So much evidence decides, and no more is kept."""
FADES = 0.125
"""Where both feet do the same, evidence fades by this much of the time."""


class WhoseMotion:
    """One foot's evidence on the fixes that are said to be its own. Instants in ns, places in m, stage."""

    def __init__(self) -> None:
        self._seen: dict[Kind, deque[tuple[int, Array]]] = {"marker": deque(maxlen=16), "depth": deque(maxlen=16)}
        self._for_us_s = 0.0

    @property
    def is_others(self) -> bool:
        """Whether they move as the other foot does, and as this one does not."""
        return self._for_us_s <= -SURE_S

    @property
    def is_ours(self) -> bool:
        """Whether they move as this foot does, and as the other one does not."""
        return self._for_us_s >= SURE_S

    def clear(self) -> None:
        """The stage moved, or nobody knows where it is."""
        for seen in self._seen.values():
            seen.clear()
        self._for_us_s = 0.0

    def see(self, t: int, kind: Kind, point: Array, sigma: float, ours: Moves, others: Moves) -> None:
        """A fix of ``t`` at ``point``, whose noise is ``sigma`` per axis, m, and how the two feet move."""
        seen = self._seen[kind]
        if seen and not 0 < t - seen[-1][0] <= SPAN_S * 1e9:
            # What was ours then need not be now.
            seen.clear()
            self._for_us_s = min(self._for_us_s, 0.0)
        elif seen and float(np.linalg.norm(point - seen[-1][1])) > FASTEST * (t - seen[-1][0]) * 1e-9:
            seen.clear()
        weight = min((t - seen[-1][0]) * 1e-9, LONGEST_PICTURE_S) if seen else 0.0
        seen.append((t, point))
        while (t - seen[0][0]) * 1e-9 > SPAN_S:
            seen.popleft()
        if (t - seen[0][0]) * 1e-9 < LEAST_SPAN_S:
            return
        way = float(np.linalg.norm(point - seen[0][1])) - 2.0 * sigma
        if STILL < way < MOVING:
            return
        moves = way >= MOVING
        we, they = ours(seen[0][0], t), others(seen[0][0], t)
        if we is None or they is None:
            return
        if we == they:
            self._for_us_s -= math.copysign(min(FADES * weight, abs(self._for_us_s)), self._for_us_s)
        elif we != moves:
            self._for_us_s = max(self._for_us_s - weight, -MOST_S)
        elif moves or self._for_us_s < 0.0:
            # What stands while we stand may be any tag on the floor.
            self._for_us_s = min(self._for_us_s + weight, MOST_S if moves else 0.0)


def moves(timeline: Timeline, frm: int, to: int) -> bool | None:
    """Whether an IMU shows its foot swinging (True) or standing (False) from ``frm`` to ``to``, ns; None: neither."""
    t = timeline.t[: timeline.n]
    first, end = int(np.searchsorted(t, frm)), int(np.searchsorted(t, to, side="right"))
    rows = timeline.rows[first:end]
    rows = rows[rows[:, KIND] == IMU]
    if first == 0 or len(rows) == 0:
        return None
    stands = rows[:, ZERO_SIGMA] > 0.0
    if stands.all():
        return False
    turning = np.square(rows[:, GYRO : GYRO + 3]).sum(axis=1)
    half = (len(rows) + 1) // 2
    # A foot that has just landed is not known to stand yet.
    fast = min(turning[:half].mean(), turning[-half:].mean()) > SWINGS**2
    return True if fast and not stands.any() else None
