"""Whether measurements come when they always do: a clock that jumped shows in their order and their age.

Stamps that are wrong cannot be told from those of pictures that were held up: these fit all the same, and those fit
where a foot stands. What must not happen is that they overrule a foot that moves, or move the camera's mount.
"""

from __future__ import annotations

from bisect import insort
from collections import deque

OFF_S = 0.035
"""An age that differs by so much from what is usual is strange: two pictures."""
_SHORT_S, _LONG_S = 0.1, 1.0
"""Ages are remembered so often: those of the last few seconds, and those of a minute."""
_KEPT = 61


class Punctuality:
    """One source's messages. Instants in ns."""

    def __init__(self) -> None:
        self._newest: int | None = None
        self._usual = (_Median(_SHORT_S), _Median(_LONG_S))

    def is_out_of_turn(self, t: int, now: int) -> bool:
        """Whether what is stamped ``t`` and arrives at ``now`` is older than what came before it."""
        if self._newest is not None and t < self._newest:
            return True
        self._newest = min(t, now)
        return False

    def is_strange(self, t: int, now: int) -> bool:
        """Whether its age is none that is usual, neither of late nor for long."""
        age = (now - t) * 1e-9
        strange = all(abs(age - each.value(age)) > OFF_S for each in self._usual)
        for each in self._usual:
            each.add(now, age)
        return strange


class _Median:
    """Of the last _KEPT ages that were noted, one each ``every_s``."""

    def __init__(self, every_s: float) -> None:
        self._every = round(every_s * 1e9)
        self._due: int | None = None
        self._ages: deque[float] = deque()
        self._sorted: list[float] = []

    def value(self, otherwise: float) -> float:
        return self._sorted[len(self._sorted) // 2] if self._sorted else otherwise

    def add(self, now: int, age: float) -> None:
        if self._due is not None and 0 <= self._due - now <= self._every:
            return
        self._due = now + self._every
        self._ages.append(age)
        insort(self._sorted, age)
        if len(self._ages) > _KEPT:
            self._sorted.remove(self._ages.popleft())
