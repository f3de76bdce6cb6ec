"""The text of Bayer 2021: ``t,L,x,y,z;`` linear acceleration, m/s^2, and ``t,R,r,i,j,k;`` rotation, scalar first.

The paper gives the order and the semicolon; the comma and microseconds are our reading, so both are settings.
"""

from __future__ import annotations

import re

from foottrack_service.imu.formats.framing import Splitter
from foottrack_service.imu.formats.pairing import Pairing
from foottrack_service.imu.sample import Decoder, DeviceClock, DeviceSample, unit_quaternion, with_gravity

COUNTER_MODULUS = 1 << 32
"""Of micros() and millis() of an Arduino; a counter with more bits unwraps just as well."""

MAX_LINEAR = 1000.0
"""m/s^2, far beyond any foot: a damaged number."""

QUATERNION_SLACK = 0.1
"""Text with two decimals is off by up to a hundredth."""

_NUMBER = rb"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,2})?)"
_LONGEST = 200
_PERIOD_RISE = 1.05
_PERIOD_SHARE = 0.45


class AsciiDecoder(Decoder):
    """[B]'s text. ``pair_within_us``: how far apart an acceleration and its rotation may be, half a period of 100 Hz;
    at higher rates it shrinks by itself, or a lost message would pair each with its neighbour's from then on.

    Drops: ``syntax``, ``range``, ``quaternion``, ``unpaired``, ``overlong``.
    """

    def __init__(self, separator: str = ",", tick_us: float = 1.0, pair_within_us: float = 5000.0) -> None:
        super().__init__()
        # Arduinos run off ceramic resonators, half a percent off.
        self.clock = DeviceClock(COUNTER_MODULUS, tick_us, tolerance=0.01)
        self._splitter = Splitter(b";", _LONGEST, self.drops)
        comma = re.escape(separator.encode())
        numbers = {count: comma.join([_NUMBER] * count) for count in (3, 4)}
        self._message = re.compile(
            rb"\s*(\d{1,19})" + comma + rb"(?:L" + comma + numbers[3] + rb"|R" + comma + numbers[4] + rb")\s*"
        )
        self._widest = max(1, round(pair_within_us / tick_us))
        self._pairing = Pairing(("L", "R"), COUNTER_MODULUS, self._widest, self.drops)
        self._last: int | None = None
        self._period = 2.0 * self._widest

    def feed(self, data: bytes) -> list[DeviceSample]:
        samples = []
        for frame in self._splitter.feed(data):
            sample = self._parse(frame)
            if sample is not None:
                samples.append(sample)
        return samples

    def _parse(self, frame: bytes) -> DeviceSample | None:
        match = self._message.fullmatch(frame)
        if match is None:
            self.drops["syntax"] += 1
            return None
        t, *numbers = match.groups()
        ticks = int(t)
        if numbers[0] is not None:
            acc = (float(numbers[0]), float(numbers[1]), float(numbers[2]))
            if not all(abs(value) <= MAX_LINEAR for value in acc):
                self.drops["range"] += 1
                return None
            self._learn_period(ticks)
            pair = self._pairing.add("L", ticks, acc)
        else:
            r, i, j, k = (float(number) for number in numbers[3:])
            q = unit_quaternion(i, j, k, r, QUATERNION_SLACK)
            if q is None:
                self.drops["quaternion"] += 1
                return None
            pair = self._pairing.add("R", ticks, q)
        if pair is None:
            return None
        ticks, acc = pair["L"]
        q = pair["R"][1]
        return DeviceSample(ticks, with_gravity(acc, q), q=q)

    def _learn_period(self, ticks: int) -> None:
        if self._last is not None:
            since = (ticks - self._last) % COUNTER_MODULUS
            # The least one counts: a lost message looks like a longer period.
            self._period = max(1.0, min(since, _PERIOD_RISE * self._period))
            self._pairing.tolerance = min(self._widest, int(_PERIOD_SHARE * self._period))
        self._last = ticks
