"""How the IMU sits on the shoe, from standing and one step."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service import rotations as rot
from foottrack_service.config import FeetSettings, FootSettings, Placement, Settings
from foottrack_service.fusion.imu_mounting import MountingError, find_mounting
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array
from foottrack_service.simulation.scenario import simulate

MOUNTINGS = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.2], [0.0, 2.0, 0.0], [-0.6, -1.5, 0.4], [0.2, np.pi, 0.1]]


def one_step(turn: list[float], kind: str, seed: int) -> tuple[list[ImuSample], Array]:
    """Three seconds of standing, then the left foot's first step of the task "steps"."""
    q = rot.from_rotation_vector(turn)
    x, y, z, w = q.tolist()
    foot = FootSettings(imu=Placement(p=(0.0, 0.02, -0.06), q=(x, y, z, w)))
    settings = Settings(feet=FeetSettings(left=foot))
    run = simulate("steps", seed, seconds=6.0, imu_hz=200.0, imu=kind, settings=settings, camera=False, right_imu=False)
    samples = [
        ImuSample(
            m.t,
            np.array(m.data.acc),
            None if m.data.gyro is None else np.array(m.data.gyro),
            None if m.data.q is None else np.array(m.data.q),
        )
        for _, m in run.messages()
        if m.stream == "imu/left"
    ]
    # The task begins to walk at once: its first moment of standing is held for 3 s.
    first = samples[0]
    step = 5_000_000
    random = np.random.default_rng(seed)
    before = [
        ImuSample(first.t - i * step, first.acc + 0.02 * random.normal(size=3), first.gyro, first.q)
        for i in range(600, 0, -1)
    ]
    return before + samples, q


@pytest.mark.parametrize("kind", ["raw", "fused"])
@pytest.mark.parametrize("turn", MOUNTINGS)
def test_any_mounting_is_found_from_one_step(turn: list[float], kind: str) -> None:
    samples, q = one_step(turn, kind, 3)
    found = find_mounting(samples)
    assert np.rad2deg(rot.angle_between(found.q, q)) < 5.0


def standing(n: int) -> list[ImuSample]:
    return [ImuSample(i * 5_000_000, np.array([0.0, 9.80665, 0.0]), np.zeros(3), None) for i in range(n)]


@pytest.mark.parametrize(("samples", "advice"), [([], "too few"), (standing(800), "never moved")])
def test_what_shows_nothing_says_what_to_do(samples: list[ImuSample], advice: str) -> None:
    with pytest.raises(MountingError, match=advice):
        find_mounting(samples)


def test_a_foot_that_never_stood_still() -> None:
    random = np.random.default_rng(1)
    samples = [ImuSample(s.t, s.acc + 5.0 * random.normal(size=3), s.gyro, None) for s in standing(800)]
    with pytest.raises(MountingError, match="stand still"):
        find_mounting(samples)
