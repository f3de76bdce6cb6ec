"""What pictures of a standing foot tell: its height, by camera and floor together, and never its tilt."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings
from foottrack_service.fusion.foot_filter_inertial import InertialFilter
from foottrack_service.fusion.interface import HeadSample, ImuSample, OpticalFix, Verdict
from foottrack_service.rotations import IDENTITY, Array

STEP_NS = 2_500_000
UP = np.array([0.0, STANDARD_GRAVITY, 0.0])
EYES = np.array([0.0, 1.6, 0.1])
FOOT = FootSettings()


def seen(
    t: int, random: np.random.Generator, scale: float, standing_at: float, noise: float, tilt_noise: float
) -> OpticalFix:
    """The tag of a foot that stands straight ahead at the height ``standing_at``, m, of its sole."""
    ankle = np.array([-0.1, standing_at + FOOT.ankle_height, 0.0])
    head = HeadSample(t, EYES, IDENTITY)
    p = (ankle + np.array(FOOT.marker.p) - EYES) * scale + noise * random.standard_normal(3)
    q = rot.multiply(
        np.array(FOOT.marker.q), rot.from_rotation_vector([tilt_noise, tilt_noise, 0.01] * random.standard_normal(3))
    )
    cov = max(noise, 1e-3) ** 2 * np.eye(3)
    return OpticalFix(t, "marker", p, q, None, cov, 1.0, 50.0, head, head)


def stood(
    seconds: float,
    *,
    scale: float = 1.0,
    standing_at: float = 0.0,
    noise: float = 0.0,
    tilt_noise: float = 0.0,
    floor: bool = True,
    force: Array = UP,
) -> InertialFilter:
    filter_, random, taken = InertialFilter(FOOT, "left", floor=floor), np.random.default_rng(5), 0
    for i in range(round(seconds * 1e9 / STEP_NS)):
        filter_.on_imu(ImuSample(i * STEP_NS, force, np.zeros(3), None))
        if i % 7 == 6:
            fix = seen((i - 12) * STEP_NS, random, scale, standing_at, noise, tilt_noise)
            taken += filter_.on_fix(fix) is Verdict.ACCEPTED
    assert taken > 40 * seconds
    return filter_


def height(filter_: InertialFilter) -> float:
    return float(filter_.predicted(filter_.newest)[0][1]) - FOOT.ankle_height


def test_pictures_of_a_standing_foot_say_nothing_of_its_tilt() -> None:
    bias = np.array([0.15, 0.0, -0.1])
    filter_ = stood(10.0, noise=0.003, tilt_noise=0.06, scale=1.005, force=UP + bias)
    x, P = filter_.state
    # What leans by 0.15 / g looks just so; only who moves can tell.
    assert np.abs(x[[10, 12]]).max() < 0.03
    assert np.sqrt(P[[9, 11], [9, 11]]).min() > 0.12
    assert math.sqrt(P[6, 6]) > 0.012
    assert math.sqrt(P[8, 8]) > 0.012


@pytest.mark.parametrize("scale", [0.995, 1.005])
def test_floor_and_camera_share_what_they_disagree_by(scale: float) -> None:
    # The tag is 1.5 m below the eyes: half a per cent is 7 mm and a half, and the floor is worth 5 mm.
    off = abs(scale - 1.0) * (EYES[1] - FOOT.ankle_height)
    assert abs(height(stood(3.0, scale=scale, noise=0.003))) < 0.45 * off
    assert abs(height(stood(3.0, scale=scale, noise=0.003, floor=False))) > 0.8 * off


def test_a_foot_that_is_lifted_is_seen_through_the_same_camera() -> None:
    filter_ = stood(3.0, scale=1.005)
    ankle, q, _, _ = filter_.predicted(filter_.newest)
    fix = seen(filter_.newest, np.random.default_rng(1), 1.005, 0.3, 0.0, 0.0)
    filter_.on_fix(fix)
    residual = filter_._foot["residual"][0]
    lifted = ankle + rot.rotate(q, FOOT.marker.p) + residual - np.array(FOOT.marker.p)
    assert abs(lifted[1] - FOOT.ankle_height - 0.3) < 0.45 * 0.005 * (EYES[1] - FOOT.ankle_height - 0.3)


@pytest.mark.parametrize("standing_at", [-0.05, 0.05, 0.17])
def test_who_stands_on_something_else_is_not_pulled_to_the_floor(standing_at: float) -> None:
    assert abs(height(stood(3.0, standing_at=standing_at, noise=0.003)) - standing_at) < 0.004
