"""The compiled pose of a square, beside OpenCV's own."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from foottrack_service import rotations
from foottrack_service.camera import pose_kernel
from foottrack_service.camera.targets import Tag

PLAIN = np.eye(3)
FOCAL = 612.0


def seen(seed: int, distance: float, size: float, noise_px: float) -> np.ndarray:
    """Rays (4, 2) to the corners of a tag anywhere in a D435's picture, leaning up to some 60 degrees."""
    source = np.random.default_rng(seed)
    axis = source.normal(size=3)
    lean = rotations.from_rotation_vector(source.uniform(0.05, 1.05) * axis / np.linalg.norm(axis))
    q = rotations.multiply([1.0, 0.0, 0.0, 0.0], lean)
    p = distance * np.array([source.uniform(-0.6, 0.6), source.uniform(-0.35, 0.35), 1.0])
    corners = rotations.rotate(q, Tag(0, size).corners()) + p
    return np.asarray(corners[:, :2] / corners[:, 2:] + source.normal(0.0, noise_px / FOCAL, (4, 2)))


def by_opencv(size: float, rays: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotation (3, 3) and place (3,) of both solutions."""
    count, turns, places, _ = cv2.solvePnPGeneric(
        Tag(0, size).corners(), rays, PLAIN, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    assert count == 2
    return [(cv2.Rodrigues(turn)[0], np.ravel(place)) for turn, place in zip(turns, places, strict=True)]


def fitted(size: float, rays: np.ndarray) -> tuple[float, float]:
    """The least sum of squared residuals, px^2: of both poses that the kernel refines, and of both by OpenCV."""
    model = Tag(0, size).corners()
    R, q, p, cov = np.empty((2, 3, 3)), np.empty((2, 4)), np.empty((2, 3)), np.empty((2, 3, 3))
    ours = pose_kernel.fit_both(size, np.eye(3), np.zeros(3), rays, model, rays, R, q, p, cov)
    for i in (0, 1):
        np.testing.assert_allclose(rotations.to_matrix(q[i]), R[i], atol=1e-12)
        assert np.linalg.eigvalsh(cov[i]).min() > 0.0
    theirs = []
    for turn, place in by_opencv(size, rays):
        rotvec, p_cv = cv2.solvePnPRefineLM(
            model, rays, PLAIN, None, cv2.Rodrigues(turn)[0], place.reshape(3, 1).copy(), (3, 200, 1e-14)
        )
        projected = cv2.projectPoints(model, rotvec, p_cv, PLAIN, None)[0].reshape(4, 2)
        theirs.append(float(np.square(projected - rays).sum()))
    return FOCAL**2 * min(square for square in ours if square >= 0.0), FOCAL**2 * min(theirs)


tags = given(st.integers(0, 10**6), st.floats(0.4, 2.5), st.sampled_from([0.03, 0.06, 0.10]))


@settings(max_examples=200, deadline=None)
@tags
def test_both_attitudes_are_those_of_opencv(seed: int, distance: float, size: float) -> None:
    for noise_px in (0.0, 0.5):
        rays = seen(seed, distance, size, noise_px)
        R, p = np.empty((2, 3, 3)), np.empty((2, 3))
        assert pose_kernel._ippe(size, rays, R, p)
        theirs = by_opencv(size, rays)
        apart = np.array([[np.abs(mine - other).max() for other, _ in theirs] for mine in R])
        assert min(apart[0, 0] + apart[1, 1], apart[0, 1] + apart[1, 0]) < 1e-5
        if noise_px == 0.0:
            # OpenCV's place is the best for all four corners, ours what the centre says: the same for exact ones.
            assert min(np.abs(place - theirs[0][1]).max() for place in p) < 1e-9


@settings(max_examples=100, deadline=None)
@tags
def test_the_better_pose_fits_as_well_as_the_best_of_opencv(seed: int, distance: float, size: float) -> None:
    ours, theirs = fitted(size, seen(seed, distance, size, 0.5))
    assert ours < theirs + 0.02
