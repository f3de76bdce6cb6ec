"""A resting foot of which its filter is sure of something impossible: rest alone brings it back, without a picture."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.foot_filter_kernel import LARGEST_ACC_BIAS
from foottrack_service.fusion.interface import ImuSample
from foottrack_service.rotations import Array

STEP_S = 0.005
UP = np.array([0.0, 1.0, 0.0])


def resting(filter_: InertialFilter, frm: float, to: float) -> None:
    """Samples of a foot at rest, with a good sensor's noise."""
    random = np.random.default_rng(7)
    for t in np.arange(frm, to, STEP_S):
        acc = 9.80665 * UP + 0.02 * random.standard_normal(3)
        filter_.on_imu(ImuSample(round(t * 1e9), acc, 0.002 * random.standard_normal(3), None))


def stood(*, v: tuple[float, float, float] = (0.0, 0.0, 0.0), turn: Array | None = None) -> InertialFilter:
    """A filter after a second of rest, of which it now believes this, and is sure."""
    filter_ = InertialFilter(FootSettings(), "left", floor=False)
    resting(filter_, 0.0, 1.0)
    x, P = filter_.state
    x[3:6] = v
    P[3:6], P[:, 3:6] = 0.0, 0.0
    P[range(3, 6), range(3, 6)] = 0.01**2
    if turn is not None:
        x[6:10] = rot.multiply(rot.from_rotation_vector(turn), x[6:10])
        P[6:9], P[:, 6:9] = 0.0, 0.0
        P[range(6, 9), range(6, 9)] = 0.01**2
    return filter_


@pytest.mark.parametrize("v", [(6.0, 0.0, 0.0), (0.0, -0.4, 0.3)])
def test_a_speed_that_is_surely_wrong_is_given_up(v: tuple[float, float, float]) -> None:
    filter_ = stood(v=v)
    resting(filter_, 1.0, 1.1)
    # A tenth of a second of calm may be the middle of a swing.
    assert np.linalg.norm(filter_.state[0][3:6]) > 0.9 * np.linalg.norm(v)
    resting(filter_, 1.1, 1.5)
    x, P = filter_.state
    assert np.linalg.norm(x[3:6]) < 0.01
    # Where it is nobody knows then: it has gone astray by more than was seen.
    assert np.sqrt(P[:3, :3].trace()) > 0.9 * np.linalg.norm(v)


def test_a_tilt_that_is_surely_wrong_is_levelled() -> None:
    filter_ = stood(turn=np.array([0.4, 0.0, -0.2]))
    resting(filter_, 1.0, 1.5)
    up = rot.rotate(filter_.state[0][6:10], UP)
    # What is nearer than 0.05 the biases may be, and levels slowly.
    assert np.linalg.norm(np.cross(up, UP)) < 0.06


def test_an_impossible_bias_of_the_accelerometer_is_forgotten() -> None:
    filter_ = stood()
    x, P = filter_.state
    x[10:13] = 0.0, 0.0, 1.5 * LARGEST_ACC_BIAS
    P[9:12], P[:, 9:12] = 0.0, 0.0
    P[range(9, 12), range(9, 12)] = 1e-6
    resting(filter_, 1.0, 2.0)
    assert np.linalg.norm(filter_.state[0][10:13]) < 0.1
    assert np.linalg.norm(rot.rotate(filter_.state[0][6:10], UP) - UP) < 0.03
