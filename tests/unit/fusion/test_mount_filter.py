"""The mount's filter: exact derivatives, no bias from noise, and errors that its covariance owns up to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mount_scenes import CAMERA, DOWN, NONE, Look, seen

from foottrack_protocol.messages import MountValues, Side
from foottrack_service import rotations as rot
from foottrack_service.fusion.compiled_rotations import quaternion, rotation
from foottrack_service.fusion.interface import OpticalFix
from foottrack_service.fusion.mount_filter import MountFilter
from foottrack_service.fusion.mount_kernel import (
    LENS,
    NEIGHBOURS,
    POINTS,
    SHIFT,
    STATES,
    TURN,
    WANDER_TURN,
    innovation,
    look,
    pass_time,
)
from foottrack_service.rotations import Array

LEFT = POINTS
CAMERA_WAY = rotation(quaternion(DOWN, 0))
NOTHING = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def off_by(filter_: MountFilter, lack: tuple[Array, Array]) -> Array:
    """rad and m, shape (6,)."""
    turn = rot.to_rotation_vector(rot.multiply(filter_.turn, rot.conjugate(lack[0])))
    return np.concatenate([turn, filter_.shift - lack[1]])


def test_derivatives_are_those_of_finite_differences() -> None:
    random = np.random.default_rng(3)
    head_p, head_q = np.array([0.1, 1.6, -0.2]), rot.normalised(random.normal(size=4))
    camera_p = (0.0, 0.0, -0.08)
    turn = rot.from_rotation_vector([0.02, -0.01, 0.03])
    x = np.zeros(STATES)
    x[SHIFT:POINTS] = 0.004 * random.normal(size=POINTS - SHIFT)
    x[LEFT : LEFT + 3] = head_p + rot.rotate(head_q, [0.2, -1.5, -0.3])

    def off(x: Array, turn: Array, H: Array) -> Array:
        y = np.empty(3)
        innovation(x, turn, LEFT, camera_p, CAMERA_WAY, head_p, head_q, np.zeros(3), 0.0, NOTHING, y, H)
        return y

    H = np.zeros((3, STATES))
    off(x, turn, H)
    step = 1e-6
    for i in range(STATES):
        ahead, behind = x.copy(), x.copy()
        turns = [turn, turn]
        if i < SHIFT:
            small = step * np.eye(3)[i - TURN]
            turns = [rot.multiply(rot.from_rotation_vector(sign * small), turn) for sign in (1.0, -1.0)]
        else:
            ahead[i] += step
            behind[i] -= step
        change = off(behind, turns[1], np.zeros((3, STATES))) - off(ahead, turns[0], np.zeros((3, STATES)))
        # The lens' rest is a small thing of a small thing, and moves with nothing; wander is a small turn.
        tolerance = 0.02 if i < LENS or i >= WANDER_TURN else 1e-6
        assert np.allclose(H[:, i], change / (2.0 * step), atol=tolerance), i


def test_a_picture_is_taken_as_a_kalman_filter_takes_it() -> None:
    x, turn, last = np.zeros(STATES), rot.IDENTITY.copy(), np.zeros(3)
    P = np.diag(np.linspace(1e-6, 1e-5, STATES))
    before = P.copy()
    x[LEFT : LEFT + 3] = [0.1, -1.5, -0.3]
    p, cov = np.array([0.101, -1.503, -0.299]), np.diag([1e-6, 2e-6, 3e-6])
    H, y = np.zeros((3, STATES)), np.empty(3)
    head_p, head_q = np.zeros(3), rot.IDENTITY.copy()
    innovation(x, turn, LEFT, (0.0, 0.0, -0.08), CAMERA_WAY, head_p, head_q, p, 0.0, NOTHING, y, H)
    S = H @ before @ H.T + cov
    gain = before @ H.T @ np.linalg.inv(S)
    expected = x + gain @ y
    seen_as = (LEFT, np.array(CAMERA.p), DOWN.copy(), head_p, head_q, p, cov, 0.0)
    distance, _ = look(x, turn, P, *seen_as, 16.3, last)
    assert np.isclose(distance, y @ np.linalg.solve(S, y))
    assert np.allclose(x[SHIFT:], expected[SHIFT:], atol=1e-12)
    assert np.allclose(rot.to_rotation_vector(turn), expected[:SHIFT], atol=1e-9)
    assert np.allclose(P, before - gain @ S @ gain.T, atol=1e-15)
    assert np.allclose(last, NEIGHBOURS * y)
    kept = (x.copy(), turn.copy(), P.copy())
    far = (*seen_as[:5], p + 0.1, cov, 0.0)
    assert look(x, turn, P, *far, 16.3, last)[0] > 16.3
    assert all(np.array_equal(a, b) for a, b in zip(kept, (x, turn, P), strict=True))


def test_time_makes_the_wander_new_and_all_else_a_little_less_known() -> None:
    x, P, walks = np.ones(STATES), np.eye(STATES), np.full(STATES, 0.1)
    pass_time(x, P, 0.5, walks)
    assert np.allclose(x[WANDER_TURN:POINTS], 0.5) and np.allclose(np.delete(x, range(WANDER_TURN, POINTS)), 1.0)
    assert np.allclose(np.diag(P)[WANDER_TURN:POINTS], 0.25 + 0.1)
    assert np.allclose(np.delete(np.diag(P), range(WANDER_TURN, POINTS)), 1.1)


def test_the_head_s_noise_passes_for_no_shift() -> None:
    """A pose's noise is in what is measured and in what turns the shift: uncorrected, 10 mm here."""
    random_look = Look(turning=0.2, head=0.001, pixel=0.0003, depth=0.0024)
    errors = []
    for seed in range(4):
        filter_ = MountFilter(CAMERA)
        seen(filter_.add, 0.0, 60.0, NONE, random_look, seed)
        errors.append(off_by(filter_, NONE)[3:])
    assert np.abs(np.mean(errors, axis=0)).max() < 0.005


def test_scale_and_lens_are_in_what_it_says_of_itself() -> None:
    """Thousands of pictures average no error that is the same in all of them."""
    random = np.random.default_rng(11)
    squares = []
    for seed in range(8):
        lack = (rot.from_rotation_vector(0.01 * random.normal(size=3)), 0.005 * random.normal(size=3))
        scale, lens = 0.005 * random.normal(), 0.0008 * random.normal(size=2)
        filter_ = MountFilter(CAMERA)
        head = Look(turning=0.4, head=0.0004, pixel=0.0005, scale=scale, lens=(lens[0], lens[1]))
        seen(filter_.add, 0.0, 40.0, lack, head, seed)
        off = off_by(filter_, lack)
        squares.append(off @ np.linalg.solve(filter_.covariance, off))
    # Chi-square with 48 degrees of freedom, 99.9 %; far below it the filter would make itself smaller than it is.
    assert 6.0 < np.sum(squares) < 85.0


def test_noise_that_claims_less_than_it_is_is_learned() -> None:
    calm, rough = MountFilter(CAMERA), MountFilter(CAMERA)
    seen(calm.add, 0.0, 20.0, NONE)

    def claims_less(side: Side, fix: OpticalFix) -> None:
        rough.add(side, replace(fix, cov=fix.cov / 9.0))

    seen(claims_less, 0.0, 20.0, NONE)
    assert calm.noise < 1.5
    assert 3.0 < rough.noise < 18.0
    assert np.trace(rough.covariance) > 0.3 * np.trace(calm.covariance)


def test_what_is_known_and_what_may_have_changed() -> None:
    known = MountValues(p=(0.01, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0), sigma_p=0.001, sigma_q=0.002, base="")
    filter_ = MountFilter(CAMERA, known)
    assert filter_.shift.tolist() == [0.01, 0.0, 0.0]
    assert np.allclose(np.sqrt(np.diag(filter_.covariance)[3:]), np.hypot(0.001, 0.002))
    anew = filter_.anew()
    assert anew.shift.tolist() == [0.01, 0.0, 0.0]
    assert np.diag(anew.covariance).min() > np.diag(filter_.covariance).max() * 4.0
    before = filter_.covariance
    filter_.widen(0.01, 0.02)
    assert np.allclose(np.diag(filter_.covariance - before), [1e-4] * 3 + [4e-4] * 3)
