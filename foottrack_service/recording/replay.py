"""When what is due: the pacing of a live replay, without a clock and without a socket."""

from __future__ import annotations

from foottrack_service.recording.recording import Span

SLIP_NS = 500_000_000
"""Further behind than this (a laptop slept, the machine is too slow for the rate) a replay goes on from where it is."""
MIN_RATE, MAX_RATE = 0.01, 1000.0


class Pacer:
    """Maps the recording's time to the bus clock, both in ns; every instant is an argument.

    ``rate`` 2 plays twice as fast. Begins playing, at the first arrival.
    """

    def __init__(self, span: Span, now: int, rate: float = 1.0) -> None:
        self.span = span
        self.paused = False
        self.rate = _checked(rate)
        self._bus = now
        self._recorded = span.first

    def bus_time(self, recorded: int) -> int:
        """The instant of the bus clock at which an instant of the recording is played: stamps are moved by it.

        While paused, as if playing went on at the last pause's instant.
        """
        return self._bus + round((recorded - self._recorded) / self.rate)

    def position(self, now: int) -> int:
        """Where the replay is, in the recording's time."""
        return min(self._at(now), self.span.last)

    def wait(self, arrival: int, now: int) -> int | None:
        """How long until a message is due, ns, 0 when it is; None while paused."""
        if self.paused:
            return None
        due = self.bus_time(arrival)
        if now - due > SLIP_NS:
            self._anchor(now, arrival)
            return 0
        return max(due - now, 0)

    def pause(self, now: int) -> None:
        """Stand still at the position."""
        self._anchor(now, self._at(now))
        self.paused = True

    def resume(self, now: int) -> None:
        """Go on from the position."""
        self._anchor(now, self._at(now))
        self.paused = False

    def set_rate(self, rate: float, now: int) -> None:
        """Go on at another rate. Raises ValueError outside 0.01 to 1000."""
        rate = _checked(rate)
        self._anchor(now, self._at(now))
        self.rate = rate

    def seek(self, recorded: int, now: int) -> int:
        """Go to an instant of the recording, and say the one reached: it is kept within the recording."""
        reached = min(max(recorded, self.span.first), self.span.last)
        self._anchor(now, reached)
        return reached

    def _at(self, now: int) -> int:
        return self._recorded if self.paused else self._recorded + round((now - self._bus) * self.rate)

    def _anchor(self, bus: int, recorded: int) -> None:
        self._bus, self._recorded = bus, recorded


def _checked(rate: float) -> float:
    if not MIN_RATE <= rate <= MAX_RATE:
        raise ValueError(f"a rate is {MIN_RATE} to {MAX_RATE:g}, not {rate}")
    return rate
