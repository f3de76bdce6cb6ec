"""Device time to bus time: jitter, skew, wrap-around, resets, against simulated truth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from foottrack_service.imu.dejitter import Dejitter
from foottrack_service.imu.sample import DeviceClock

MICROS = DeviceClock(1 << 32, 1.0, 0.01)
RVC = DeviceClock(256, 10_000.0, 0.05)
SHTP = DeviceClock(256, 2_500.0, 0.1)
START = 3 * 10**14
LATENCY_S = 0.001

Jitter = Callable[[np.random.Generator, npt.NDArray[np.float64]], npt.NDArray[np.float64]]


def scheduler(rng: np.random.Generator, t: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return rng.exponential(0.002, len(t))


def usb_polls_each_16_ms(rng: np.random.Generator, t: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.ceil(t / 0.016017) * 0.016017 - t


def radio(rng: np.random.Generator, t: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    held_up = (rng.random(len(t)) < 0.005) * rng.uniform(0.02, 0.2, len(t))
    return rng.exponential(0.005, len(t)) + held_up


class Run:
    """One stream through a dejitter; errors in ms against the true instants plus the least delay."""

    def __init__(self, clock: DeviceClock, skew: float, jitter: Jitter, seconds: float = 60.0) -> None:
        period_s = clock.tick_us * 1e-6 if clock.modulus == 256 else 0.01
        count = round(seconds / period_s)
        self.true = np.arange(count) * period_s / (1.0 + skew)
        ticks = np.arange(count) if clock.modulus == 256 else np.arange(count) * 10_000
        arrival = self.true + LATENCY_S + jitter(np.random.default_rng(1), self.true)
        self.arrival = np.maximum.accumulate(arrival)
        self.dejitter = Dejitter(clock)
        # From shortly before the wrap of 32 bits.
        first = 2**32 - 20_000_000
        self.stamps = [
            self.dejitter.stamp((first + int(tick)) % clock.modulus, START + int(arr * 1e9))
            for tick, arr in zip(ticks, self.arrival, strict=True)
        ]
        self.t = np.array([stamp.t - START for stamp in self.stamps]) * 1e-9
        self.error_ms = (self.t - self.true - LATENCY_S) * 1e3
        self.settled = self.error_ms[count // 6 :]


@pytest.mark.parametrize("clock", [MICROS, RVC, SHTP])
@pytest.mark.parametrize(("jitter", "spread_ms"), [(scheduler, 0.2), (usb_polls_each_16_ms, 0.4), (radio, 0.4)])
def test_jitter_of_8_ms_becomes_errors_below_one(clock: DeviceClock, jitter: Jitter, spread_ms: float) -> None:
    run = Run(clock, 80e-6 if clock is MICROS else 2e-3, jitter)
    raw_ms = (run.arrival - run.true - LATENCY_S) * 1e3
    assert np.mean(raw_ms) > 1.9
    assert abs(np.mean(run.settled)) < 1.0
    assert np.std(run.settled) < spread_ms
    assert np.std(run.settled) < 0.3 * np.std(raw_ms)
    assert run.dejitter.resets == 0


@pytest.mark.parametrize("clock", [MICROS, RVC])
def test_stamps_never_go_back_nor_lie_in_the_future(clock: DeviceClock) -> None:
    run = Run(clock, 1e-4, radio)
    assert np.all(np.diff(run.t) >= 0.0)
    assert np.all(run.t <= run.arrival + 1e-9)


@pytest.mark.parametrize("skew", [-5e-3, -100e-6, 0.0, 100e-6, 5e-3])
def test_the_skew_is_found(skew: float) -> None:
    run = Run(MICROS, skew, scheduler)
    assert run.dejitter.skew == pytest.approx(1.0 / (1.0 + skew) - 1.0, abs=10e-6)


def test_the_counter_is_unwrapped() -> None:
    for clock in (MICROS, RVC):
        run = Run(clock, 0.0, scheduler)
        steps = np.diff([stamp.t_dev_us for stamp in run.stamps])  # type: ignore[arg-type]
        assert set(steps) == {10_000}


def test_lost_samples_over_a_wrap_of_eight_bits_are_told_from_few() -> None:
    dejitter = Dejitter(RVC)
    for k in [*range(500), *range(900, 1000)]:
        stamp = dejitter.stamp(k % 256, START + k * 10_000_000)
        assert abs(stamp.t - START - k * 10_000_000) < 100_000
    assert stamp.t_dev_us == 9_990_000
    assert dejitter.resets == 0


def test_without_jitter_nothing_is_changed() -> None:
    dejitter = Dejitter(MICROS)
    for k in range(1000):
        assert abs(dejitter.stamp(k * 2500, START + k * 2_500_000).t - (START + k * 2_500_000)) <= 1


def test_a_device_that_starts_anew_is_noticed_at_its_first_sample() -> None:
    dejitter = Dejitter(MICROS)
    for k in range(2000):
        dejitter.stamp(77_000_000 + k * 10_000, START + k * 10_000_000)
    restart = START + 21_000_000_000
    for k in range(100):
        stamp = dejitter.stamp(1_000 + k * 10_000, restart + k * 10_000_000)
        assert abs(stamp.t - restart - k * 10_000_000) < 100_000
    assert dejitter.resets == 1
    assert stamp.t_dev_us == 991_000


def test_a_restart_with_a_counter_of_eight_bits() -> None:
    dejitter = Dejitter(SHTP)
    for k in range(1000):
        dejitter.stamp(k % 256, START + k * 2_500_000)
    restart = START + 1000 * 2_500_000 + 100_000_000
    # 1000 % 256 = 232: the counter falls back to 0, which looks like 24 lost samples, 60 ms, after a pause of 100.
    for k in range(4000):
        stamp = dejitter.stamp(k % 256, restart + k * 2_500_000)
        assert 0 <= restart + k * 2_500_000 - stamp.t < 50_000_000
    assert abs(stamp.t - restart - 3999 * 2_500_000) < 2_000_000


def test_a_stall_with_kept_data_does_not_move_the_clock() -> None:
    dejitter = Dejitter(MICROS)
    for k in range(3000):
        true = k * 10_000_000
        arrival = max(true, 20_700_000_000) if 2000 <= k < 2070 else true
        stamp = dejitter.stamp(k * 10_000, START + arrival)
        assert abs(stamp.t - START - true) < 500_000
    assert dejitter.resets == 0


@pytest.mark.parametrize("clock", [MICROS, RVC])
@pytest.mark.parametrize("stall_ms", [40, 100, 300, 1000])
def test_a_stall_at_the_start_is_forgotten_as_soon_as_it_ends(clock: DeviceClock, stall_ms: int) -> None:
    """A service that is still starting reads what came meanwhile in one go."""
    dejitter = Dejitter(clock)
    rng = np.random.default_rng(2)
    for k in range(1000):
        true_ns = k * 10_000_000
        arrival = max(true_ns + int(rng.exponential(800_000)), stall_ms * 1_000_000)
        ticks = k if clock is RVC else k * 10_000
        stamp = dejitter.stamp(ticks % clock.modulus, START + arrival)
        if true_ns > (stall_ms + 100) * 1_000_000:
            assert abs(stamp.t - START - true_ns) < 3_000_000
    assert stamp.t_dev_us == 9_990_000


def test_a_lasting_change_of_delay_is_a_new_clock_after_a_second() -> None:
    dejitter = Dejitter(MICROS)
    for k in range(3000):
        shift = 400_000_000 if k >= 1000 else 0
        stamp = dejitter.stamp(k * 10_000, START + k * 10_000_000 + shift)
    assert dejitter.resets == 1
    assert abs(stamp.t - START - 2999 * 10_000_000 - 400_000_000) < 100_000


def test_an_age_that_the_device_reports_is_taken_off() -> None:
    dejitter = Dejitter(None)
    assert dejitter.stamp(None, 5_000_000, age_us=3000).t == 2_000_000
    # Never before what was already said.
    assert dejitter.stamp(None, 5_000_000, age_us=4000).t == 2_000_000
    assert dejitter.stamp(None, 6_000_000).t_dev_us is None
    assert dejitter.skew == 0.0


def test_repeated_ticks_and_arrivals_do_no_harm() -> None:
    dejitter = Dejitter(MICROS)
    for k in range(3000):
        stamp = dejitter.stamp((k // 3) * 7500, START + (k // 3) * 7_500_000)
    assert abs(stamp.t - START - 999 * 7_500_000) < 10_000
    assert dejitter.resets == 0


def test_an_hour_of_silence_is_survived() -> None:
    dejitter = Dejitter(MICROS)
    for k in range(500):
        dejitter.stamp(k * 10_000, START + k * 10_000_000)
    later = 3_600_000_000
    stamp = dejitter.stamp(later % 2**32, START + later * 1000)
    assert abs(stamp.t - START - later * 1000) < 50_000_000
