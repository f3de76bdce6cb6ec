"""Allan deviation: by hand, and on synthetic noise with known coefficients."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from foottrack_service.imu.allan import AllanNoise, TooShort, allan_curve, fit_noise

PERIOD_S = 0.01
COUNT = 1 << 19
"""87 minutes at 100 Hz."""

TRUE = AllanNoise(quantisation=2e-6, random_walk=1e-4, bias_instability=3e-5, rate_random_walk=2e-6, ramp=5e-8)

Signal = npt.NDArray[np.float64]


def quantisation(q: float, rng: np.random.Generator) -> Signal:
    return np.diff(rng.normal(scale=q, size=COUNT + 1)) / PERIOD_S


def white(n: float, rng: np.random.Generator) -> Signal:
    return rng.normal(scale=n / math.sqrt(PERIOD_S), size=COUNT)


def flicker(b: float, rng: np.random.Generator) -> Signal:
    """Kasdin 1995: half an integration of white noise of variance B^2 has the spectrum B^2 / (2 pi f)."""
    k = np.arange(1, COUNT)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    size = 2 * COUNT
    spectrum = np.fft.rfft(response, size) * np.fft.rfft(rng.normal(scale=b, size=COUNT), size)
    return np.asarray(np.fft.irfft(spectrum, size)[:COUNT])


def walk(k: float, rng: np.random.Generator) -> Signal:
    return np.cumsum(rng.normal(scale=k * math.sqrt(PERIOD_S), size=COUNT))


def ramp(r: float, rng: np.random.Generator) -> Signal:
    return r * PERIOD_S * np.arange(COUNT)


ALONE = {
    "quantisation": (quantisation, 0.03),
    "random_walk": (white, 0.03),
    "bias_instability": (flicker, 0.15),
    "rate_random_walk": (walk, 0.15),
    "ramp": (ramp, 0.01),
}


@pytest.mark.parametrize("name", list(ALONE))
def test_each_noise_alone_is_found_and_no_other_stands_out(name: str) -> None:
    make, tolerance = ALONE[name]
    true = getattr(TRUE, name)
    curve = allan_curve(make(true, np.random.default_rng(5)), PERIOD_S)
    found = fit_noise(curve)
    assert getattr(found, name) == pytest.approx(true, rel=tolerance)
    model = AllanNoise(**{**dict.fromkeys(ALONE, 0.0), name: true}).deviation(curve.tau)
    # The model is of continuous time: averages of one to four samples differ, and long ones have few neighbours.
    known = (curve.tau > 4.5 * PERIOD_S) & (curve.tau < 30.0)
    np.testing.assert_allclose(curve.deviation[known], model[known], rtol=0.1)


def test_all_five_together() -> None:
    rng = np.random.default_rng(6)
    strong = AllanNoise(quantisation=2e-6, random_walk=5e-5, bias_instability=6e-5, rate_random_walk=6e-6, ramp=4e-7)
    signal = sum((make(getattr(strong, name), rng) for name, (make, _) in ALONE.items()), start=np.full(COUNT, 9.80665))
    found = fit_noise(allan_curve(signal, PERIOD_S))
    assert found.quantisation == pytest.approx(strong.quantisation, rel=0.05)
    assert found.random_walk == pytest.approx(strong.random_walk, rel=0.1)
    assert found.bias_instability == pytest.approx(strong.bias_instability, rel=0.3)
    assert found.rate_random_walk == pytest.approx(strong.rate_random_walk, rel=0.6)
    assert found.ramp == pytest.approx(strong.ramp, rel=0.3)


def test_the_first_point_by_hand() -> None:
    # For averages of one sample: half the mean square of the steps from sample to sample.
    signal = np.tile([0.0, 2.0, 1.0], 400)
    steps = np.diff(signal)
    curve = allan_curve(signal, 1.0)
    assert curve.tau[0] == 1.0
    assert curve.deviation[0] == pytest.approx(math.sqrt(np.mean(steps**2) / 2.0))


def test_the_models_slopes() -> None:
    tau = np.array([1.0, 100.0])
    for noise, ratio in [
        (AllanNoise(1, 0, 0, 0, 0), 1 / 100),
        (AllanNoise(0, 1, 0, 0, 0), 1 / 10),
        (AllanNoise(0, 0, 1, 0, 0), 1),
        (AllanNoise(0, 0, 0, 1, 0), 10),
        (AllanNoise(0, 0, 0, 0, 1), 100),
    ]:
        low, high = noise.deviation(tau)
        assert high / low == pytest.approx(ratio)
    assert AllanNoise(0, 0, 1, 0, 0).deviation([5.0]) == pytest.approx(0.6643, abs=1e-4)


def test_what_says_nothing() -> None:
    with pytest.raises(TooShort, match="999"):
        allan_curve(np.zeros(999), 0.01)
    with pytest.raises(ValueError, match="finite"):
        allan_curve(np.full(2000, np.nan), 0.01)
    assert fit_noise(allan_curve(np.full(2000, 9.81), 0.01)) == AllanNoise(0.0, 0.0, 0.0, 0.0, 0.0)
