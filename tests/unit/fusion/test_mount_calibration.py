"""The camera's mount, found while feet stand and the head moves; a slip is noticed; what moves is no stance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mount_scenes import CAMERA, NONE, Look, seen

from foottrack_protocol.messages import MountValues, Side
from foottrack_service import rotations as rot
from foottrack_service.fusion.interface import HeadSample, OpticalFix
from foottrack_service.fusion.mount_calibration import MountCalibrator
from foottrack_service.rotations import Array

TURN = rot.from_rotation_vector(np.deg2rad([1.0, -0.5, 0.6]))
SHIFT = np.array([0.008, -0.004, 0.006])
LOOK = Look()


def shown(calibrator: MountCalibrator, frm: float, to: float, lack: tuple[Array, Array], look: Look = LOOK) -> None:
    """Both feet stand all the time, as far as anybody says; times in s."""
    seen(lambda side, fix: calibrator.add(side, fix, standing=True), frm, to, lack, look)


def test_a_degree_and_a_centimetre_are_found_within_a_minute() -> None:
    calibrator = MountCalibrator(CAMERA)
    shown(calibrator, 0.0, 40.0, (TURN, SHIFT))
    found = calibrator.estimate()
    assert found is not None
    assert found.good
    assert np.rad2deg(rot.angle_between(found.q, TURN)) < 0.1
    assert np.abs(found.p - SHIFT).max() < 0.002
    assert calibrator.slips == 0


def test_nothing_is_said_of_a_few_pictures_and_little_before_the_head_has_moved() -> None:
    calibrator = MountCalibrator(CAMERA)
    assert calibrator.estimate() is None
    shown(calibrator, 0.0, 0.4, NONE)
    assert calibrator.estimate() is None
    shown(calibrator, 0.4, 0.8, NONE)
    found = calibrator.estimate()
    assert found is not None
    assert not found.good and not found.useful


def test_feet_get_a_correction_that_they_need_soon_and_no_mount_that_is_right_gets_worse() -> None:
    wrong, right = MountCalibrator(CAMERA), MountCalibrator(CAMERA)
    rough = Look(pixel=0.003, depth=0.006)
    shown(wrong, 0.0, 6.0, (TURN, SHIFT), rough)
    shown(right, 0.0, 6.0, NONE, rough)
    needed, idle = wrong.estimate(), right.estimate()
    assert needed is not None and idle is not None
    assert needed.foot > 0.015 > 0.006 > idle.foot
    assert needed.useful and not idle.useful
    assert 0.001 < idle.sigma_foot < 0.003


def test_what_is_known_already_is_where_it_begins() -> None:
    a, b, c = SHIFT.tolist()
    x, y, z, w = TURN.tolist()
    known = MountValues(p=(a, b, c), q=(x, y, z, w), sigma_p=0.001, sigma_q=0.001, base="")
    calibrator = MountCalibrator(CAMERA, known)
    assert calibrator.estimate() is None
    shown(calibrator, 0.0, 8.0, (TURN, SHIFT))
    found, fresh = calibrator.estimate(), MountCalibrator(CAMERA)
    shown(fresh, 0.0, 8.0, (TURN, SHIFT))
    without = fresh.estimate()
    assert found is not None and without is not None
    assert np.rad2deg(rot.angle_between(found.q, TURN)) < 0.1
    assert found.sigma_q < without.sigma_q
    # A mount that has moved since is found all the same.
    shown(calibrator, 8.0, 50.0, NONE)
    assert calibrator.slips == 1
    moved = calibrator.estimate()
    assert moved is not None
    assert np.rad2deg(rot.angle_between(moved.q, rot.IDENTITY)) < 0.15


def test_a_slipped_mount_is_noticed_and_found_anew() -> None:
    calibrator = MountCalibrator(CAMERA)
    shown(calibrator, 0.0, 30.0, NONE)
    assert calibrator.slips == 0
    shown(calibrator, 30.0, 70.0, (TURN, SHIFT))
    found = calibrator.estimate()
    assert calibrator.slips == 1
    assert found is not None
    assert np.rad2deg(rot.angle_between(found.q, TURN)) < 0.15


def test_a_foot_that_moves_says_nothing_of_the_mount() -> None:
    calibrator = MountCalibrator(CAMERA)
    shown(calibrator, 0.0, 20.0, NONE)
    before = calibrator.estimate()
    shown(calibrator, 20.0, 30.0, NONE, Look(moving=True))
    after = calibrator.estimate()
    assert before is not None and after is not None
    assert calibrator.slips == 0
    assert np.rad2deg(rot.angle_between(before.q, after.q)) < 0.1


@pytest.mark.parametrize("turn_deg, shift", [(2.0, 0.010), (0.5, 0.005)])
def test_a_slip_is_noticed_within_seconds_and_counted_once(turn_deg: float, shift: float) -> None:
    for seed in range(3):
        random = np.random.default_rng(seed)
        axis, way = random.normal(size=(2, 3))
        turn = rot.from_rotation_vector(np.deg2rad(turn_deg) * axis / np.linalg.norm(axis))
        slipped = (turn, shift * way / np.linalg.norm(way))
        calibrator = MountCalibrator(CAMERA)
        shown(calibrator, 0.0, 30.0, NONE)
        assert calibrator.slips == 0
        shown(calibrator, 30.0, 45.0, slipped)
        assert calibrator.slips == 1
        shown(calibrator, 45.0, 80.0, slipped)
        assert calibrator.slips == 1
        found = calibrator.estimate()
        assert found is not None
        assert rot.angle_between(found.q, slipped[0]) < 4.0 * found.sigma_q
        assert np.abs(found.p - slipped[1]).max() < 4.0 * found.sigma_p


def test_a_mount_that_stays_is_not_said_to_slip() -> None:
    for look in (LOOK, Look(turning=0.2, head=0.0007, scale=0.004, lens=(0.0008, -0.0005))):
        calibrator = MountCalibrator(CAMERA)
        shown(calibrator, 0.0, 120.0, (TURN, SHIFT), look)
        assert calibrator.slips == 0


def test_a_stage_that_moved_is_no_slip() -> None:
    calibrator = MountCalibrator(CAMERA)
    shown(calibrator, 0.0, 20.0, NONE)

    def moved(side: Side, fix: OpticalFix) -> None:
        head = HeadSample(fix.t, fix.head.p + [0.3, 0.0, 0.1], fix.head.q)
        calibrator.add(side, replace(fix, head=head), standing=True)

    calibrator.recentred()
    seen(moved, 20.0, 40.0, NONE)
    assert calibrator.slips == 0


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_what_is_no_number_is_left_out(broken: float) -> None:
    calibrator = MountCalibrator(CAMERA)
    head = HeadSample(0, np.zeros(3), rot.IDENTITY)
    fix = OpticalFix(0, "marker", np.array([broken, 0.0, 0.0]), None, None, np.eye(3), 1.0, 50.0, head, head)
    calibrator.add("left", fix, standing=True)
    shown(calibrator, 0.0, 10.0, NONE)
    found = calibrator.estimate()
    assert found is not None and np.isfinite([*found.p, *found.q]).all()
