"""Where the pelvis faces: the head's yaw, slowly, and never far from where the feet point."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

SETTLE_S = 0.5
"""Time constant with which the pelvis follows a head that turns over standing feet."""
MOST_TURN = math.radians(5.0)
"""How far the pelvis turns against the feet's mean: a look aside is the neck's. While the upper body turns over
standing feet the simulated pelvis is found to 3.5 deg with it (30 deg: 15), and in walks as well as with more."""
FORGET_S = 1.0
"""After such a hole it begins anew."""
_OPPOSED = 0.5
"""Mean direction of two feet shorter than this: they point apart by more than 120 deg, and say nothing together."""


class PelvisFacing:
    """Follows head and feet through time. Angles in rad, 0 towards -Z, positive to the left; stamps in ns."""

    def __init__(self, settle_s: float = SETTLE_S, most_turn: float = MOST_TURN) -> None:
        self._settle_s, self._most = settle_s, most_turn
        self.reset()

    def reset(self) -> None:
        """Begin anew: the stage jumped."""
        self._t: int | None = None
        self._yaw = 0.0
        self._feet: float | None = None
        self._count = 0

    def update(self, t: int, head: float | None, feet: Sequence[float]) -> float:
        """The pelvis's yaw at ``t`` from the head's and those of the feet, as far as they are known.

        With the feet it turns at once, over the feet slowly: so it neither lags behind a person who turns on the spot
        nor follows every look.
        """
        middle = _mean(feet)
        aim = self._aim(head, middle)
        elapsed = math.inf if self._t is None else (t - self._t) * 1e-9
        if not 0.0 <= elapsed <= FORGET_S:
            self._yaw = aim
        else:
            if middle is not None and self._feet is not None and len(feet) == self._count:
                self._yaw += _wrapped(middle - self._feet)
            self._yaw += _wrapped(aim - self._yaw) * -math.expm1(-elapsed / self._settle_s)
        self._t, self._feet, self._count = t, middle, len(feet)
        self._yaw = _wrapped(self._yaw)
        return self._yaw

    def _aim(self, head: float | None, middle: float | None) -> float:
        if middle is None:
            return self._yaw if head is None else head
        turn = 0.0 if head is None else _wrapped(head - middle)
        return middle + max(-self._most, min(self._most, turn))


def head_yaw(q: Sequence[float]) -> float:
    """Yaw of a head (q head to stage) by its turn about up, which looking straight down does not upset."""
    return 2.0 * math.atan2(q[1], q[3])


def foot_yaw(q: Sequence[float]) -> float:
    """Yaw of a foot (q foot to stage) by its lateral axis, which stays level when the foot points down."""
    x, y, z, w = q
    return math.atan2(2.0 * (w * y - x * z), 1.0 - 2.0 * (y * y + z * z))


def _mean(yaws: Iterable[float]) -> float | None:
    sine = cosine = 0.0
    count = 0
    for yaw in yaws:
        sine, cosine, count = sine + math.sin(yaw), cosine + math.cos(yaw), count + 1
    return math.atan2(sine, cosine) if count and math.hypot(sine, cosine) > _OPPOSED * count else None


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
