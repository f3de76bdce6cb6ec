"""Device time to bus time.

Bytes arrive late by a delay that is never negative and varies (USB polls, schedulers, radios). The device's counter is
regular but drifts. A line through (counter, arrival), fitted by recursive least squares with exponential forgetting,
keeps the regularity and follows the drift: liblsl's method (``time_postprocessor.cpp``), here against the device's own
counter instead of a sample count, with the origin moved along with the newest sample, which keeps the numbers small.
The fitted line runs through the *mean* delay; what a sample really needs is known from those that were not held up, so
the line is then lowered to the earliest arrivals.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from foottrack_service.imu.sample import DeviceClock

HALF_TIME_S = 90.0
"""After which an arrival counts half; liblsl's default."""

EARLY_S = 0.05
"""A sample cannot arrive before it was measured: so far ahead of the line, the device has a new clock."""

YOUNG_S = 2.0
"""A line so young hangs on its first samples. When those were held up, as by a service that was still starting ..."""

YOUNG_EARLY_S = 5e-3
"""... the next are early by so much, and the line begins at them: bent by all of them, it would err for minutes."""

LATE_S = 0.25
"""Later ones were held up and say nothing about the clock ..."""

LATE_FOR_S = 1.0
"""... unless it goes on for so long."""

FLOOR_RISE = 3e-4
"""s/s, how fast the least delay is forgotten: slower keeps first errors longer, faster lets some jitter through."""

CLIP = 3.0
"""A delay pulls at most so many mean residuals: one of 200 ms among those of 5 must not bend the line."""

CLIP_START_S = 5e-3
CLIP_SHARE = 0.02
"""Of one sample in the mean residual."""


_NOISE_S = 2e-3
_START_VARIANCE = (1.0 / _NOISE_S) ** 2
_BACKWARDS_FROM_S = 60.0
"""A counter with a period longer than this that goes back has started anew; a shorter one has wrapped."""


class Stamp(NamedTuple):
    """``t``: sampling instant, bus clock, ns. ``t_dev_us``: the device's counter, unwrapped, us, or None."""

    t: int
    t_dev_us: int | None


class Dejitter:
    """One device's clock. ``resets`` counts how often it started anew."""

    def __init__(self, clock: DeviceClock | None, half_time_s: float = HALF_TIME_S) -> None:
        self.resets = 0
        self._clock = clock
        self._forget_per_s = 0.5 ** (1.0 / half_time_s)
        self._fit: _Fit | None = None
        self._last_t: int | None = None

    @property
    def skew(self) -> float:
        """Bus seconds per second of the device, less one; 0 while nothing is known."""
        return 0.0 if self._fit is None else self._fit.skew

    def restart(self, clock: DeviceClock | None) -> None:
        """The device was replugged, reset or set to another rate."""
        self._clock = clock
        if self._fit is not None:
            self.resets += 1
        self._fit = None

    def stamp(self, ticks: int | None, t_arr: int, age_us: int = 0) -> Stamp:
        """The instant of a sample that arrived at ``t_arr`` (ns) and was then at least ``age_us`` old.

        Never later than that, and never before an earlier sample's.
        """
        t = t_arr - 1000 * age_us
        if self._clock is None or ticks is None:
            return Stamp(self._monotonic(t), None)
        if self._fit is not None and self._fit.is_another_clock(ticks, t):
            self.restart(self._clock)
        if self._fit is None:
            self._fit = _Fit(self._clock, ticks, t, self._forget_per_s)
        else:
            t = self._fit.update(ticks, t)
        return Stamp(self._monotonic(t), round(self._fit.total * self._clock.tick_us))

    def _monotonic(self, t: int) -> int:
        if self._last_t is not None and t < self._last_t:
            t = self._last_t
        self._last_t = t
        return t


class _Fit:
    """The line: at the counter's value ``total`` the arrival was expected ``_offset_s`` after ``_t0``."""

    def __init__(self, clock: DeviceClock, ticks: int, t: int, forget_per_s: float) -> None:
        self._clock = clock
        self._tick_s = clock.tick_us * 1e-6
        self._forget_per_s = forget_per_s
        self._first = ticks
        self._begin(ticks, t)

    def _begin(self, total: int, t: int) -> None:
        """A line through this sample alone."""
        self.total = total
        self.skew = 0.0
        self._t0 = t
        self._offset_s = 0.0
        self._floor_s = 0.0
        self._residual_s = CLIP_START_S
        self._p00 = 1.0
        self._p01 = 0.0
        self._p11 = self._p11_start = self._clock.tolerance**2 * _START_VARIANCE
        self._late_since: float | None = None

    def is_another_clock(self, ticks: int, t: int) -> bool:
        """Whether this sample contradicts the line for good."""
        modulus = self._clock.modulus
        back = (ticks - self.total) % modulus > modulus // 2
        if back and modulus * self._tick_s > _BACKWARDS_FROM_S:
            return True
        arrival = (t - self._t0) * 1e-9
        total = self._unwrapped(ticks, arrival)
        behind = arrival - self._expected(total)
        if behind <= LATE_S:
            self._late_since = None
        elif self._late_since is None:
            self._late_since = arrival
        too_long = self._late_since is not None and arrival - self._late_since > LATE_FOR_S
        return (behind < -EARLY_S and not self._is_young(total)) or too_long

    def update(self, ticks: int, t: int) -> int:
        """The line with this sample; returns the sample's instant, ns."""
        arrival = (t - self._t0) * 1e-9
        total = self._unwrapped(ticks, arrival)
        if self._is_young(total) and arrival - self._expected(total) < self._floor_s - YOUNG_EARLY_S:
            self._begin(total, t)
            return t
        dt = (total - self.total) * self._tick_s
        self._advance(total, dt)
        behind = arrival - self._offset_s
        if behind <= LATE_S:
            gain = 1.0 / (1.0 + self._p00)
            k0, k1 = self._p00 * gain, self._p01 * gain
            pull = min(behind, CLIP * self._residual_s)
            self._residual_s += CLIP_SHARE * (abs(pull) - self._residual_s)
            self._offset_s += k0 * pull
            self.skew += k1 * pull
            self._p11 -= k1 * self._p01
            self._p01 *= gain
            self._p00 *= gain
            # The floor stays where it was when the line moves under it.
            # Faster by a standard deviation of the slope: in the first seconds it may have been too steep.
            rise = (FLOOR_RISE + _NOISE_S * math.sqrt(self._p11)) * max(dt, 0.0)
            self._floor_s = min(self._floor_s - k0 * pull + rise, arrival - self._offset_s)
        return self._t0 + round((self._offset_s + min(self._floor_s, arrival - self._offset_s)) * 1e9)

    def _is_young(self, total: int) -> bool:
        return (total - self._first) * self._tick_s < YOUNG_S

    def _advance(self, total: int, dt: float) -> None:
        self.total = total
        self._offset_s += dt * (1.0 + self.skew)
        forget = self._forget_per_s ** -max(dt, 0.0)
        self._p00 = min((self._p00 + 2.0 * dt * self._p01 + dt * dt * self._p11) * forget, _START_VARIANCE)
        self._p01 = (self._p01 + dt * self._p11) * forget
        self._p11 = min(self._p11 * forget, self._p11_start)

    def _expected(self, total: int) -> float:
        return self._offset_s + (total - self.total) * self._tick_s * (1.0 + self.skew)

    def _unwrapped(self, ticks: int, arrival: float) -> int:
        """The value congruent to ``ticks`` that is nearest to what the line expects at this arrival."""
        expected = self.total + (arrival - self._offset_s) / (self._tick_s * (1.0 + self.skew))
        modulus = self._clock.modulus
        return ticks + modulus * round((expected - ticks) / modulus)
