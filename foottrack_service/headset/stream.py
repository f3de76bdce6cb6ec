"""One source's poses as ``head/pose`` bodies: loss, jumps of the stage, and what cannot be, in one place for all."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from foottrack_protocol.messages import HeadPose, Pose
from foottrack_service import rotations
from foottrack_service.headset.rigid import Rigid

SILENCE_S = 0.25
"""A source that says nothing for so long has lost the head."""
MAX_SPEED_M_S = 6.0
MAX_RATE_RAD_S = 25.0
"""No head is faster: quick turns of a head reach 12 rad/s, lunges 3 m/s."""
SLACK_S = 0.005
"""Stamps err by so much, and poses by 3 cm and 7 deg at these speeds."""


class HeadMessage(NamedTuple):
    """A body and the instant at which it was true, bus clock, ns."""

    t: int
    body: HeadPose


class HeadStream:
    """Feed it what a source says, in order.

    ``taken`` counts messages by kind, ``drops`` what was left out, by reason. A pose that no head can have reached is
    held to be a glitch and published as not tracked; when the next one stays there the stage has jumped, which is a
    new ``origin``, without ``moved``: nobody knows how far it jumped and how far the head moved.
    """

    def __init__(self) -> None:
        self.taken: Counter[str] = Counter()
        self.drops: Counter[str] = Counter()
        self._origin = 0
        self._last: tuple[int, Rigid] | None = None
        self._suspect: tuple[int, Rigid] | None = None
        self._moves: list[Rigid | None] = []
        self._skip_check = False

    @property
    def origin(self) -> int:
        """The stage's number."""
        return self._origin

    def pose(self, t: int, head: Rigid) -> HeadMessage | None:
        """A tracked pose at ``t`` (bus clock, ns), head to stage; None for one that is as old as the last."""
        if self._last is not None and t <= self._last[0]:
            self.drops["repeated"] += 1
            return None
        if self._last is not None and not self._skip_check:
            if self._suspect is not None and _way_s(self._suspect[1], head) < _way_s(self._last[1], head):
                self._origin += 1
                self.taken["jumps"] += 1
            elif _way_s(self._last[1], head) > (t - self._last[0]) * 1e-9 + SLACK_S:
                self._suspect = (t, head)
                self.drops["glitch"] += 1
                return self._untracked(t)
        p, q = _tuple(head.p), _tuple(head.q)
        try:
            body = HeadPose(p=p, q=q, tracked=True, origin=self._origin, moved=self._moved())
        except ValidationError:
            self.drops["wire"] += 1
            return None
        self._moves.clear()
        self._skip_check, self._suspect = False, None
        self._last = (t, head)
        self.taken["poses"] += 1
        return HeadMessage(t, body)

    def lost(self, t: int) -> HeadMessage:
        """The source does not know where the head is at ``t``, ns."""
        self._suspect = None
        return self._untracked(t)

    def recentred(self, moved: Rigid | None) -> None:
        """The source says that its stage is another one from now on; ``moved`` old stage to new, if known.

        The next message tells it, whether the head is tracked or not: whoever hears of a new origin without it
        acquires anew.
        """
        self._origin += 1
        self._skip_check = True
        self._moves.append(moved)
        self.taken["recentred"] += 1

    def silent(self, now: int) -> bool:
        """Whether nothing was tracked for so long that ``lost`` is due. False before the first pose."""
        return self._last is not None and now - self._last[0] > SILENCE_S * 1e9

    def _untracked(self, t: int) -> HeadMessage:
        self.taken["untracked"] += 1
        body = HeadPose(tracked=False, origin=self._origin, moved=self._moved())
        self._moves.clear()
        return HeadMessage(t, body)

    def _moved(self) -> Pose | None:
        """All that nobody was told yet, as one movement; None when a part of it is not known."""
        whole: Rigid | None = None
        for moved in self._moves:
            if moved is None:
                return None
            whole = moved if whole is None else moved.then(whole)
        return None if whole is None else Pose(p=_tuple(whole.p), q=_tuple(whole.q))


def _way_s(a: Rigid, b: Rigid) -> float:
    """How long the fastest head takes from a to b."""
    far = float(np.linalg.norm(b.p - a.p))
    return max(far / MAX_SPEED_M_S, float(rotations.angle_between(a.q, b.q)) / MAX_RATE_RAD_S)


def _tuple(values: rotations.Array) -> tuple[float, ...]:
    return tuple(values.tolist())
