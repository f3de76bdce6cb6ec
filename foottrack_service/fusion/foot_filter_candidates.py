"""The way to a first place, and back when we are lost: fixes that are not believed, until some of them agree."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.fusion.foot_filter_events import (
    ARM,
    KIND,
    MEASURED_Q,
    POINT,
    POINT_SIGMA,
    RESET,
    SPEED,
    SPEED_SIGMA,
    TILT_SIGMA,
    TURN_SIGMA,
    YAW_SIGMA,
)
from foottrack_service.rotations import Array


@dataclass(frozen=True, slots=True)
class Rejected:
    """A fix that was not believed, and by how much it disagreed."""

    t: int
    point: Array
    residual: Array
    turn: float | None
    """Yaw by which the tag's attitude differs from ours, rad."""
    yaw_sigma: float
    """How well we know it, rad."""
    sigma: float
    arm: Array
    lean: tuple[float, float] = (0.0, 0.0)
    """Tilt by which the tag's attitude differs from ours, rad about x and z."""


SPAN_S = 0.12
"""Fixes that agree do so within this, or within what FEW of them take of a slow camera."""
GAP_S = 0.3
"""Fixes that agree lie at most so far apart, one from the next: a webcam in a dark room makes 5 pictures a second."""
FEW = 3
"""So many that agree start a foot whose place is unknown."""
SURE_SPAN_S = 0.3
"""A foot that knows its place is overruled only by fixes that agree for so long, with none accepted between."""
LOOK_S = 0.1
"""Who must insist for seconds is asked so often: each time costs a millisecond or two."""
SLACK = 0.012
"""m: fixes that agree do so within this and three sigma, along a straight drift."""
FASTEST = 4.0
"""m/s of drift, when our velocity is wrong too."""
SURE_FASTEST = 0.3
"""m/s: a foot that knows its velocity is not overruled by something that does not move with it."""
TURN_SLACK = 0.35
"""rad."""
DRIFT = 0.5
"""m/s: so fast a foot that was sure may have gone wrong; what is further away is another thing."""
TAG_YAW_SIGMA, HEAD_YAW_SIGMA = 0.1, 0.6
"""rad: how well a tag's attitude, and the head's, tell where the toes point."""
LEANS = 0.3
"""rad: who is overruled by tags that all lean so much against it does not know its tilt. (One tag errs by 0.2.)"""
SAME_TURN = 0.12
"""rad: a tag that lies on the shoe as ours does is most likely ours, however sure the foot is of its place."""


class Candidates:
    """Fixes that were not believed, until enough of them agree that it is us who are wrong."""

    def __init__(self) -> None:
        self._kept: deque[Rejected] = deque(maxlen=64)
        self._insists: tuple[int, int] | None = None
        """Since when they have agreed, and when they did last, ns."""

    def clear(self) -> None:
        """A fix was accepted."""
        self._kept.clear()
        self._insists = None

    def add(self, rejected: Rejected, sure_for: float | None, insist_s: float = 0.0) -> list[Rejected] | None:
        """The fixes that agree with this newest one, oldest first, when they suffice; else None.

        ``sure_for``: seconds since the last accepted fix, of a foot that knows its place and speed well; else None.
        ``insist_s``: for so long they must agree, where more than agreement speaks against them.
        """
        if self._kept and not 0 < rejected.t - self._kept[-1].t <= GAP_S * 1e9:
            self._kept.clear()
        self._kept.append(rejected)
        if insist_s > 0.0:
            agreeing = self._insisting()
            enough = self._insists is not None and rejected.t - self._insists[0] >= insist_s * 1e9 and bool(agreeing)
        elif sure_for is None:
            span = max(SPAN_S, self._pace_s())
            agreeing = self._agreeing(span, FASTEST, TURN_SLACK)
            if len(agreeing) < FEW:
                # With a speed that is out of all reason nothing agrees.
                agreeing = self._agreeing(span, FASTEST, TURN_SLACK, points=True)
            enough = len(agreeing) >= FEW
        else:
            agreeing = self._agreeing(SPAN_S, FASTEST, SAME_TURN)
            near = float(np.linalg.norm(rejected.residual)) < SLACK + 3.0 * rejected.sigma + DRIFT * sure_for
            same = all(k.turn is not None and abs(k.turn) < SAME_TURN for k in agreeing)
            enough = len(agreeing) > FEW and near and same
            if not enough:
                agreeing = self._insisting()
                enough = bool(agreeing)
        if not enough:
            return None
        self.clear()
        # Only the last few start the filter anew: the older ones belong to a time when it was still confused.
        return agreeing[-2 * FEW :]

    def _insisting(self) -> list[Rejected]:
        """Those that have agreed for SURE_SPAN_S by now; empty when they have not. Notes since when they do."""
        t = self._kept[-1].t
        if self._insists is not None and 0 <= t - self._insists[1] < LOOK_S * 1e9:
            return []
        agreeing = self._agreeing(2.0 * SURE_SPAN_S, SURE_FASTEST, TURN_SLACK)
        if self._insists is not None and not 0 <= t - self._insists[1] <= 2e9 * SURE_SPAN_S:
            self._insists = None
        if len(agreeing) <= FEW or t - agreeing[0].t < SURE_SPAN_S * 1e9:
            return []
        self._insists = (agreeing[0].t if self._insists is None else self._insists[0], t)
        return agreeing

    def _pace_s(self) -> float:
        """How long the last FEW fixes took, and a little."""
        if len(self._kept) < FEW:
            return 0.0
        return 1.1e-9 * (self._kept[-1].t - self._kept[-FEW].t)

    def _agreeing(self, span: float, fastest: float, turn_slack: float, *, points: bool = False) -> list[Rejected]:
        """Those of the last ``span`` s whose residuals, or ``points``, lie on one straight drift with the newest's."""
        newest = self._kept[-1]
        found = [newest]
        for older in reversed(list(self._kept)[:-1]):
            if newest.t - older.t > span * 1e9:
                break
            trial = [older, *found]
            if _on_a_line(trial, fastest, turn_slack, points=points):
                found = trial
        return found


def fill_reset(row: Array, agreed: list[Rejected], q: Array, toes: float | None) -> bool:
    """Write the event that starts place, speed and yaw anew at the oldest of the fixes that agree into ``row``.

    ``q`` is the sensor's attitude there; without a tag's attitude it is turned by ``toes``, rad, or kept (None).
    Returns whether a tag gave the yaw.
    """
    first, last = agreed[0], agreed[-1]
    span = (last.t - first.t) * 1e-9
    row[KIND] = RESET
    row[POINT : POINT + 3] = first.point
    row[ARM : ARM + 3] = first.arm
    row[SPEED : SPEED + 3] = (last.point - first.point) / span
    row[POINT_SIGMA] = 0.03
    row[SPEED_SIGMA] = 0.5 + 3.0 * first.sigma / span
    turns = [k.turn for k in agreed if k.turn is not None]
    turn = turns[len(turns) // 2] if turns else toes
    if turn is not None:
        row[MEASURED_Q : MEASURED_Q + 4] = rot.multiply(rot.from_yaw(turn), q)
        row[TURN_SIGMA] = 1.0
        row[YAW_SIGMA] = TAG_YAW_SIGMA if turns else HEAD_YAW_SIGMA
    lean = float(np.linalg.norm(np.median([k.lean for k in agreed], axis=0)))
    row[TILT_SIGMA] = lean if lean > LEANS else 0.0
    return bool(turns)


def _on_a_line(kept: list[Rejected], fastest: float, turn_slack: float, *, points: bool) -> bool:
    t = np.array([(k.t - kept[-1].t) * 1e-9 for k in kept])
    residuals = np.array([k.point if points else k.residual for k in kept])
    slope = np.zeros(3)
    if len(kept) > 2:
        centred = t - t.mean()
        slope = centred @ residuals / (centred @ centred)
    else:
        slope = (residuals[-1] - residuals[0]) / (t[-1] - t[0])
    speed = float(np.linalg.norm(slope))
    sigma = max(k.sigma for k in kept)
    if speed * (t[-1] - t[0]) > fastest * (t[-1] - t[0]) + SLACK + 3.0 * sigma:
        return False
    off = residuals - residuals.mean(axis=0) - np.outer(t - t.mean(), slope)
    if float(np.max(np.linalg.norm(off, axis=1))) > SLACK + 3.0 * sigma:
        return False
    turns = [k.turn for k in kept if k.turn is not None]
    return len(turns) < 2 or all(abs(math.remainder(turn - turns[-1], math.tau)) < turn_slack for turn in turns)
