"""[Z]'s trial: a countdown, then a way of 50 m walked in place, and how long it took."""

from __future__ import annotations

from typing import NamedTuple

COUNTDOWN_S = 3.0
DISTANCE_M = 50.0
_HOLE_S = 0.5
"""Between two speeds: a longer pause moves nobody."""


class TrialResult(NamedTuple):
    """How it went."""

    seconds: float
    """From "go" to the end of the way, or to the last speed that was seen."""
    distance: float
    """m."""
    mean_speed: float
    """m/s, over the seconds."""
    top_speed: float
    """m/s."""
    steps: int
    finished: bool


class Trial:
    """Feed ``update`` with speeds; before the countdown ends they do not count."""

    def __init__(self, distance: float = DISTANCE_M, countdown: float = COUNTDOWN_S) -> None:
        self._goal, self._countdown = distance, countdown
        self._began: int | None = None
        self._last: int | None = None
        self._gone = self._seconds = self._top = 0.0
        self._first_steps: int | None = None
        self._steps = 0

    def countdown(self, t: int) -> float:
        """Seconds until "go", 0 after it; the first call (ns) starts the clock."""
        if self._began is None:
            self._began = t
        return max(0.0, self._countdown - (t - self._began) * 1e-9)

    @property
    def distance(self) -> float:
        """m so far."""
        return self._gone

    @property
    def finished(self) -> bool:
        """Whether the way is done."""
        return self._gone >= self._goal

    def update(self, t: int, speed: float, steps: int) -> None:
        """The avatar's speed (m/s) from ``t`` ns on, and how many steps were taken since the service began."""
        if self.countdown(t) > 0.0 or self.finished:
            return
        if self._first_steps is None:
            self._first_steps, self._last = steps, t
        assert self._last is not None
        dt = (t - self._last) * 1e-9
        if dt < 0.0:
            return
        self._last, self._steps = t, steps - self._first_steps
        self._seconds += dt
        if dt > _HOLE_S:
            return
        way = min(speed * dt, self._goal - self._gone)
        if way < speed * dt:  # the finish lies within this interval
            self._seconds -= dt - way / speed
            self._gone = self._goal
        else:
            self._gone += way
        self._top = max(self._top, speed)

    @property
    def result(self) -> TrialResult:
        """So far, or when finished."""
        mean = self._gone / self._seconds if self._seconds > 0.0 else 0.0
        return TrialResult(self._seconds, self._gone, mean, self._top, self._steps, self.finished)
