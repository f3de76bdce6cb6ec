"""How long others must insist before a foot is overruled: what stands by its IMU is still where it was.

A tag with the wrong identity agrees with itself as well as a true one does. What it cannot have is a foot that went
there: a foot that has rested since its last good fix is not 20 cm further. Only who insists for as long as the foot was
known overrules it, and then the old place is remembered: fixes that say it again are believed at once. Likewise two
feet are never in one place, so a fix where the other foot is known to be shows that one.
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.fusion.foot_filter_candidates import Candidates, Rejected
from foottrack_service.fusion.interface import Kind, Target
from foottrack_service.fusion.whose_motion import WhoseMotion
from foottrack_service.rotations import Array

FAR = 0.12
"""m: what is nearer may be a mount that slipped, or a foot that was pushed; other tags are further away."""
SETTLES_S = 0.1
"""Unrest in all that a foot may show (its heel shifts, somebody bumps into it) and still be in its place."""
LEAST_S, MOST_S = 0.3, 12.0
"""Between these is how long others must insist."""
TRUSTED_S = 2.0
"""A place that has been known for less is given up for less than that: it may be what others have just insisted on."""
SAME_PLACE = 0.05
"""m, beyond three sigma."""
OTHERS_S = 4.0
"""So long at least who claims the other foot's place is taken for the other foot."""
TAKEN = 0.08
"""m, and three sigma of the other foot: two shoes' tags are never so near to each other."""
FURTHEST_TAKEN, NEARER = 0.25, 0.6
"""m, and share of the way to our own place: a foot that walks unseen drifts, and its tag may be so far off it."""
OTHER_WAY, OTHER_WAY_S = 0.5, 1.0
"""rad, beyond three sigma: a tag that points so much elsewhere is the other foot's in a turn, or insists."""
AT_OURS = 0.4
"""Share of the way from the other's place: what is nearer to ours may be ours, however it moved."""
NOT_OURS = 0.05
"""m: a fix that is nearer to where we expect it is looked at no further."""
PROBATION_S = 0.15
"""A place that fixes have confirmed for less than this is given up as lightly as none."""
SURE_AGE_S = 0.9
SURE_SIGMA = 0.03
"""m per axis: a foot that knows its place so well, and was seen so lately, is no easy prey even when it moves."""
_LONGEST_STEP_S = 0.25


class Doubt:
    """One foot's evidence. Instants in ns; ``unrest`` is the IMU's running total of seconds in which it moved."""

    def __init__(self) -> None:
        self.whose = WhoseMotion()
        self._known_s = 0.0
        """For so long accepted fixes have shown the foot where it is held to be."""
        self._accepted: int | None = None
        self._rested_at = -math.inf
        self._taken_since: int | None = None
        self._before: tuple[Array, float] | None = None
        self._candidates: dict[Kind, Candidates] = {"marker": Candidates(), "depth": Candidates()}
        self._fix_t: dict[Kind, int] = {}

    def accept(self, t: int, kind: Kind, unrest: float, moving: bool, strange: bool) -> None:
        """A fix of ``t`` was accepted; ``moving``: the accepted ones show that the foot moves.

        ``strange``: its stamp may be wrong. It may have put the foot where it was at another time, so others need not
        insist.
        """
        self._candidates["depth"].clear()
        self._taken_since = None
        if strange:
            self._rested_at = -math.inf
            return
        self._fix_t[kind] = t
        if kind == "marker":
            # However long blobs have agreed, a tag that does not is right soon; and blobs wander.
            if self._accepted is not None:
                self._known_s += min(max((t - self._accepted) * 1e-9, 0.0), _LONGEST_STEP_S)
            self._accepted = t
            self._candidates["marker"].clear()
            self._rested_at = -math.inf if moving else unrest

    def clear(self) -> None:
        """Fixes that were not believed say nothing any more."""
        for candidates in self._candidates.values():
            candidates.clear()

    def forget(self) -> None:
        """Nobody knows where the foot is, or where the stage is."""
        self._known_s, self._accepted, self._taken_since = 0.0, None, None
        self._rested_at, self._before = -math.inf, None
        self.whose.clear()
        self.clear()

    def moved(self, p: Array, q: Array) -> None:
        """The stage moved, old to new."""
        self.whose.clear()
        self.clear()
        if self._before is not None:
            self._before = (p + rot.rotate(q, self._before[0]), self._before[1])

    def agreed(self, rejected: Rejected, kind: Kind, sigma: float | None, unrest: float) -> list[Rejected] | None:
        """The fixes that agree with this one which was not believed, when they suffice to begin anew; else None.

        ``sigma``: m per axis, how well the foot knows its place; None when it does not.
        """
        insist_s = None
        if sigma is not None and not self.whose.is_ours and self._known_s >= PROBATION_S:
            insist_s = self._insist_s(rejected, unrest)
        if insist_s == 0.0 and rejected.turn is not None and abs(rejected.turn) > OTHER_WAY + 3.0 * rejected.yaw_sigma:
            insist_s = OTHER_WAY_S
        sure_for = None if insist_s is None or sigma is None else self._sure_for(sigma, rejected.t, kind)
        found = self._candidates[kind].add(rejected, sure_for, insist_s or 0.0)
        if found is not None:
            self._before = (rejected.point - rejected.residual, unrest) if self._certain(unrest) else None
            self._known_s, self._accepted, self._taken_since = 0.0, rejected.t, None
            self._rested_at = unrest
            self._fix_t[kind] = found[-1].t
            self.whose.clear()
        return found

    def is_others(self, t: int, point: Array, residual: Array, unrest: float, other: Target | None) -> bool:
        """Whether a fix shows the other foot's target, which is known to be at ``other``, or moves as that one does."""
        if other is None or self.whose.is_ours or self._was_here(point, 0.0, unrest):
            return False
        gap, off = float(np.linalg.norm(point - other.p)), float(np.linalg.norm(residual))
        if self.whose.is_others and off > AT_OURS * gap:
            # However long they insist.
            self._taken_since = None
            self.clear()
            return True
        if gap > min(TAKEN + 3.0 * other.sigma, FURTHEST_TAKEN) or gap > NEARER * off:
            return False
        if self._taken_since is None or t < self._taken_since:
            self._taken_since = t
        # Two feet that began with each other's tags would wait for each other for ever.
        return other.seen or (t - self._taken_since) * 1e-9 < max(self._lasting_s, OTHERS_S)

    def _insist_s(self, rejected: Rejected, unrest: float) -> float | None:
        """How long fixes such as this one must insist, 0.0: as always; None: a few are enough."""
        slack = 3.0 * rejected.sigma
        if self._was_here(rejected.point, slack, unrest):
            return None
        far = float(np.linalg.norm(rejected.residual)) > FAR + slack
        if not far or not self._certain(unrest) or self._taken_since is not None:
            # One that was taken for the other foot's for so long has insisted already.
            return 0.0
        return self._lasting_s

    def _sure_for(self, sigma: float, t: int, kind: Kind) -> float | None:
        """Seconds since the last accepted fix, of a foot that knows its place so well that others must insist.

        A blob never makes a tag insist.
        """
        by = [self._fix_t[k] for k in (("marker",) if kind == "marker" else self._fix_t) if k in self._fix_t]
        age = (t - max(by)) * 1e-9 if by else math.inf
        return age if age <= SURE_AGE_S and sigma < SURE_SIGMA else None

    def _was_here(self, point: Array, slack: float, unrest: float) -> bool:
        """Whether a foot that has rested since was held to be there before it was overruled."""
        if self._before is None:
            return False
        place, at = self._before
        return unrest - at < SETTLES_S and float(np.linalg.norm(point - place)) < SAME_PLACE + slack

    @property
    def _lasting_s(self) -> float:
        known = self._known_s
        return min(max(known * min(known / TRUSTED_S, 1.0), LEAST_S), MOST_S)

    def _certain(self, unrest: float) -> bool:
        return unrest - self._rested_at < SETTLES_S
