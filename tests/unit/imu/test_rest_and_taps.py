"""Rest biases and the tapped sensor, on synthetic motion."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service.imu.identify import TapIdentifier
from foottrack_service.imu.rest import BadPositions, NotAtRest, acc_bias, rest

Array = npt.NDArray[np.float64]
T = np.arange(400) * 0.01
SIDES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]


def still(seed: int = 0) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    acc = np.array([0.0, STANDARD_GRAVITY + 0.08, 0.0]) + rng.normal(scale=0.02, size=(400, 3))
    gyro = np.array([0.01, -0.02, 0.005]) + rng.normal(scale=0.003, size=(400, 3))
    return acc, gyro


def test_the_biases_of_a_sensor_at_rest() -> None:
    found = rest(T, *still())
    assert found.gyro == pytest.approx([0.01, -0.02, 0.005], abs=6e-4)
    assert found.acc_bias_along_gravity == pytest.approx([0.0, 0.08, 0.0], abs=4e-3)
    assert found.seconds == pytest.approx(3.99)
    assert rest(T, still()[0], None).gyro is None


@pytest.mark.parametrize(
    ("acc", "gyro", "text"),
    [
        (lambda a: a + 0.5 * np.sin(10.0 * T)[:, None], lambda g: g, "acceleration varies"),
        (lambda a: a, lambda g: g + 0.1 * np.sin(10.0 * T)[:, None], "rate varies"),
        (lambda a: a, lambda g: g + 0.3, "turns"),
        (lambda a: a / STANDARD_GRAVITY, lambda g: g, "unit"),
        (lambda a: a[:0], lambda g: g[:0], "only 0.0 s"),
        (lambda a: np.where(T[:, None] == 0.0, np.nan, a), lambda g: g, "finite"),
        (lambda a: a, lambda g: np.where(T[:, None] == 0.0, np.nan, g), "rate varies"),
    ],
)
def test_what_is_no_rest_is_refused(acc: object, gyro: object, text: str) -> None:
    a, g = (change(signal) for change, signal in zip((acc, gyro), still(), strict=True))  # type: ignore[operator]
    with pytest.raises(NotAtRest, match=text):
        rest(T[: len(a)], a, g)


def test_a_hole_is_no_rest() -> None:
    acc, gyro = still()
    seen = (T < 1.0) | (T > 1.5)
    with pytest.raises(NotAtRest, match=r"nothing came for 0\.5 s"):
        rest(T[seen], acc[seen], gyro[seen])


def test_the_whole_bias_of_the_accelerometer_from_six_positions() -> None:
    true = np.array([0.2, -0.35, 0.1])
    rng = np.random.default_rng(1)
    tilted = np.asarray(SIDES) + rng.normal(scale=0.1, size=(6, 3))
    positions = STANDARD_GRAVITY * tilted / np.linalg.norm(tilted, axis=1, keepdims=True) + true
    assert acc_bias(positions) == pytest.approx(true, abs=1e-9)
    noisy = positions + rng.normal(scale=0.01, size=(6, 3))
    assert acc_bias(noisy) == pytest.approx(true, abs=0.03)


def test_positions_that_cannot_tell_are_refused() -> None:
    with pytest.raises(BadPositions, match="at least 4"):
        acc_bias(STANDARD_GRAVITY * np.asarray(SIDES[:3]))
    with pytest.raises(BadPositions, match="alike"):
        acc_bias(STANDARD_GRAVITY * np.array([[0, 1, 0], [0.1, 0.99, 0], [0, 0.99, 0.1], [-0.1, 0.99, 0]]))
    with pytest.raises(BadPositions, match="cannot be"):
        acc_bias(STANDARD_GRAVITY * np.asarray(SIDES) + 3.0)


class Feet:
    """Two sensors, 100 Hz, with taps, a stamp that shakes both, and steps."""

    def __init__(self) -> None:
        self.identifier = TapIdentifier()
        self.rng = np.random.default_rng(2)
        self.t = 0.0
        self.names: tuple[str, ...] = ("a", "b")

    def play(self, seconds: float, **hits: list[tuple[float, float]]) -> list[str]:
        """``hits`` by sensor: (s from now, m/s^2). Returns what was identified."""
        found = []
        begin = self.t
        while self.t < begin + seconds:
            for name in self.names:
                acc = np.array([0.0, STANDARD_GRAVITY, 0.0]) + self.rng.normal(scale=0.05, size=3)
                for at, height in hits.get(name, []):
                    ringing = self.t - begin - at
                    if 0.0 <= ringing < 0.06:
                        acc += height * np.exp(-ringing / 0.015) * np.array([0.3, 0.8, 0.5])
                who = self.identifier.add(name, self.t, (float(acc[0]), float(acc[1]), float(acc[2])))
                if who is not None:
                    found.append(who)
            self.t += 0.01
        return found


def test_the_sensor_that_is_tapped_twice() -> None:
    feet = Feet()
    assert feet.play(2.0) == []
    assert feet.play(2.0, b=[(0.5, 20.0), (0.9, 25.0)]) == ["b"]
    # The same taps do not count twice; the next ones do.
    assert feet.play(2.0) == []
    assert feet.play(2.0, a=[(0.5, 15.0), (0.8, 15.0)]) == ["a"]


@pytest.mark.parametrize(
    "hits",
    [
        {"a": [(0.5, 20.0)]},
        {"a": [(0.5, 20.0), (2.2, 20.0)]},
        {"a": [(0.5, 3.0), (0.9, 3.0)]},
        {"a": [(0.5, 30.0), (0.9, 30.0)], "b": [(0.5, 20.0), (0.9, 20.0)]},
        {"a": [(0.5, 20.0)], "b": [(0.9, 20.0)]},
    ],
    ids=["once", "too slowly", "too softly", "a stamp that both feel", "each once"],
)
def test_what_is_no_tapping(hits: dict[str, list[tuple[float, float]]]) -> None:
    assert Feet().play(4.0, **hits) == []


def test_a_sensor_that_fell_silent_is_not_waited_for() -> None:
    feet = Feet()
    assert feet.play(1.0) == []
    feet.names = ("a",)
    assert feet.play(4.0, a=[(2.0, 20.0), (2.4, 20.0)]) == ["a"]


def test_a_tap_shakes_the_other_a_little() -> None:
    feet = Feet()
    assert feet.play(3.0, a=[(0.5, 30.0), (0.9, 30.0)], b=[(0.51, 9.0), (0.91, 9.0)]) == ["a"]
