"""A lower bound: how well a foot could be known afterwards, by who knows its attitude and which fixes are good.

Fixed-interval smoother (H. Rauch, F. Tung, C. Striebel, Maximum likelihood estimates of linear dynamic systems, 1965)
over position, velocity and the accelerometer's bias (9 states) of the sensor, driven by its specific force, corrected
by the tags that our filter accepted and that were true, and by the stances that really were. Attitude is the truth's,
and so is the camera's depth scale, of which our filter learns most from the floor. It sees the future and cannot be
fooled; it has the same samples, camera and noise figures as our filter.
"""

from __future__ import annotations

import numpy as np

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings
from foottrack_service.fusion.foot_filter_kernel import ACC_BIAS_WALK, ACC_NOISE, ACC_STEP
from foottrack_service.fusion.interface import OpticalFix
from foottrack_service.rotations import Array
from foottrack_service.simulation.truth import FootTrack

STANCE_SIGMA = 0.02
"""m/s per axis: an ankle over a flat foot still sways."""
PICTURE_NOISE = 0.002
"""m per axis beyond what the camera says: head pose and mount."""
FIRST_BIAS = 0.2
"""m/s^2."""


def smoothed(
    t: Array, acc: Array, fixes: list[OpticalFix], start: int, track: FootTrack, foot: FootSettings
) -> tuple[Array, Array]:
    """Seconds (m,) and the ankle (m, 3), m, at samples and fixes between the first and the last fix.

    ``t`` (n,) s and ``acc`` (n, 3) m/s^2 are the IMU's samples; ``fixes`` come in order, ``start`` ns is where s begin.
    """
    if len(t) < 2 or len(fixes) < 2:
        return np.empty(0), np.empty((0, 3))
    order = np.argsort(t, kind="stable")
    t, acc = t[order], acc[order]
    keep = np.concatenate([[True], np.diff(t) > 0.0]) & np.isfinite(acc).all(axis=1)
    t, acc = t[keep], acc[keep]
    seen = np.array([(fix.t - start) * 1e-9 for fix in fixes])
    times = np.unique(np.concatenate([t, seen]))
    times = times[(times >= seen[0]) & (times <= seen[-1])]
    felt = np.stack([np.interp(times, t, acc[:, axis]) for axis in range(3)], axis=1)
    ankle_q = track.pose(times)[1]
    R = rot.to_matrix(rot.multiply(ankle_q, rot.normalised(np.array(foot.imu.q))))
    lever = rot.rotate(ankle_q, np.array(foot.imu.p))
    force = np.einsum("nij,nj->ni", R, felt) - np.array([0.0, STANDARD_GRAVITY, 0.0])
    heel, toe = track.contact(times)
    by_time: dict[float, OpticalFix] = dict(zip(seen.tolist(), fixes, strict=True))
    tag_arm = np.array(foot.marker.p) - np.array(foot.imu.p)
    shorter = 1.0 / _depth_scale(fixes, track.point(seen, foot.marker.p))

    n = len(times)
    X, P = np.zeros((n, 9)), np.zeros((n, 9, 9))
    X_before, P_before, F = np.zeros((n, 9)), np.zeros((n, 9, 9)), np.tile(np.eye(9), (n, 1, 1))
    x, C = np.zeros(9), np.diag([1.0] * 3 + [1.0] * 3 + [FIRST_BIAS**2] * 3)
    x[:3] = fixes[0].head.p + rot.rotate(fixes[0].head.q, fixes[0].p) - rot.rotate(ankle_q[0], tag_arm)
    for i in range(n):
        if i:
            dt = times[i] - times[i - 1]
            a = 0.5 * (force[i] + force[i - 1]) - R[i] @ x[6:9]
            F[i, 0:3, 3:6] = dt * np.eye(3)
            F[i, 0:3, 6:9], F[i, 3:6, 6:9] = -0.5 * dt * dt * R[i], -dt * R[i]
            x = x.copy()
            x[0:3] += dt * x[3:6] + 0.5 * dt * dt * a
            x[3:6] += dt * a
            step = float(np.linalg.norm(force[i] - force[i - 1]))
            density = ACC_NOISE**2 + (ACC_STEP * step) ** 2
            C = F[i] @ C @ F[i].T
            C[3:6, 3:6] += density * dt * np.eye(3)
            C[6:9, 6:9] += ACC_BIAS_WALK**2 * dt * np.eye(3)
        X_before[i], P_before[i] = x, C
        fix = by_time.get(float(times[i]))
        if fix is not None:
            head = rot.to_matrix(fix.head.q)
            z = fix.head.p + shorter * head @ fix.p - rot.rotate(ankle_q[i], tag_arm)
            x, C = _updated(x, C, 0, z, head @ fix.cov @ head.T + PICTURE_NOISE**2 * np.eye(3))
        if heel[i] and toe[i]:
            x, C = _updated(x, C, 3, np.zeros(3), STANCE_SIGMA**2 * np.eye(3))
        X[i], P[i] = x, C
    for i in range(n - 2, -1, -1):
        gain = np.linalg.solve(P_before[i + 1], F[i + 1] @ P[i]).T
        X[i] += gain @ (X[i + 1] - X_before[i + 1])
    return times, X[:, :3] - lever


def _depth_scale(fixes: list[OpticalFix], tags: Array) -> float:
    """By how much the tags, which were at ``tags`` (n, 3), m, seem further from the head than they were."""
    away = [np.linalg.norm(tag - fix.head.p) for fix, tag in zip(fixes, tags, strict=True)]
    return float(np.median([np.linalg.norm(fix.p) for fix in fixes] / np.array(away)))


def _updated(x: Array, P: Array, first: int, z: Array, noise: Array) -> tuple[Array, Array]:
    part = slice(first, first + 3)
    gain = np.linalg.solve(P[part, part] + noise, P[part]).T
    narrowed = P - gain @ P[part]
    return x + gain @ (z - x[part]), 0.5 * (narrowed + narrowed.T)
