"""Which sensor is on which foot: tap one of them twice."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from foottrack_service.imu.sample import Vec3

THRESHOLD = 6.0
"""m/s^2 above the slow part: a finger's tap on a shoe gives 10 to 50, shifting one's weight 1 to 3."""

ADVANTAGE = 2.5
"""So much harder must the tapped one be hit: a stamp shakes both shoes through the floor."""

SAME_TAP_S = 0.08
"""What follows a peak within so long rings from it; another sensor's answer comes within so long."""

PAUSE_S = (0.1, 1.2)
"""Between the two taps."""

SILENT_S = 1.0
"""A sensor that said nothing for so long is not waited for."""

_SLOW_S = 0.25


@dataclass
class _Sensor:
    slow: Vec3 | None = None
    t: float = -math.inf
    peaks: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=8))
    """(time in s, height in m/s^2)"""


class TapIdentifier:
    """Finds the sensor that was tapped twice, among any number. Time is in seconds, of the samples' own stamps.

    One tap may be a knock against a chair; two in a row, on one sensor alone, are meant.
    """

    def __init__(self) -> None:
        self._sensors: dict[str, _Sensor] = {}

    def add(self, name: str, t: float, acc: Vec3) -> str | None:
        """One sample of specific force, m/s^2; says which sensor was tapped twice, once it is certain."""
        sensor = self._sensors.setdefault(name, _Sensor())
        dt, sensor.t = t - sensor.t, t
        if sensor.slow is None or not 0.0 <= dt < _SLOW_S:
            sensor.slow = acc
            return None
        share = dt / _SLOW_S
        fast = [a - s for a, s in zip(acc, sensor.slow, strict=True)]
        sensor.slow = (
            sensor.slow[0] + share * fast[0],
            sensor.slow[1] + share * fast[1],
            sensor.slow[2] + share * fast[2],
        )
        self._note(sensor, t, math.hypot(*fast))
        return self._decide(min(other.t for other in self._sensors.values() if t - other.t < SILENT_S))

    def forget(self) -> None:
        """Begin anew, for the next sensor."""
        self._sensors.clear()

    def _note(self, sensor: _Sensor, t: float, height: float) -> None:
        if height < THRESHOLD:
            return
        if sensor.peaks and t - sensor.peaks[-1][0] < SAME_TAP_S:
            begun, highest = sensor.peaks[-1]
            sensor.peaks[-1] = (begun, max(highest, height))
        else:
            sensor.peaks.append((t, height))

    def _decide(self, seen_until: float) -> str | None:
        for name, sensor in self._sensors.items():
            if len(sensor.peaks) < 2:
                continue
            before, last = sensor.peaks[-2], sensor.peaks[-1]
            # The other sensors' samples of that time have to be there, and the ringing to be over.
            if seen_until < last[0] + SAME_TAP_S:
                continue
            if (
                PAUSE_S[0] <= last[0] - before[0] <= PAUSE_S[1]
                and self._alone(name, before)
                and self._alone(name, last)
            ):
                self.forget()
                return name
        return None

    def _alone(self, name: str, tap: tuple[float, float]) -> bool:
        return all(
            abs(t - tap[0]) > SAME_TAP_S or height * ADVANTAGE < tap[1]
            for other, sensor in self._sensors.items()
            if other != name
            for t, height in sensor.peaks
        )
