"""What a fix is worth before it is fused: plausibility, the tag's two attitudes, the distance from what we expect."""

from __future__ import annotations

import math

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings
from foottrack_service.fusion.compiled import compiled
from foottrack_service.fusion.foot_filter_events import (
    ARM,
    MEASURED_Q,
    NORMAL,
    PLACED_DELAY,
    POINT,
    POINT_COV,
    TURN_SIGMA,
)
from foottrack_service.fusion.foot_filter_kernel import NE, Vector, invert3, rotation, seen_through, turned
from foottrack_service.fusion.foot_filter_replay import attitude_error, point_model
from foottrack_service.fusion.interface import OpticalFix, Verdict
from foottrack_service.rotations import Array

CHI_SQUARE_3 = 16.3
"""99.9 % of good fixes are below (3 degrees of freedom)."""
CHI_SQUARE_1 = 16.3
SIZE_RATIO = (0.8, 1.25)
LEAST_EDGE_PX = 2.0
OLDEST_S = 0.8
HEAD_NOISE = 0.0015
"""m per axis: what the head pose adds to the picture's own noise."""
HEAD_TURN_NOISE = 0.0007
"""rad: likewise, times the distance."""
LEAST_TURN_SIGMA = 0.012
"""rad: a printed tag is not glued on straighter."""
TURN_PER_METRE = 25.0
"""rad/m: a tag's turn in the picture is known to its corner noise over its size (6 cm)."""
TILT_USABLE = 0.45
"""rad: a tag's attitude that leans more against gravity is not used."""
TILT_IMPOSSIBLE = 0.9
"""rad: and beyond this it is not our tag, wherever it is."""
BLOB_SIGMA = 0.025
"""m per axis: shoes and views differ."""
BLOB_WANDER = 0.01
"""m per axis: as other parts of the shoe come into view; the same for many pictures."""
BLOB_CORRELATED = 20.0
"""Pictures after which a blob says something new."""


def implausible(fix: OpticalFix) -> Verdict | None:
    """Why a fix is not looked at any further; None when it may be good."""
    # A sum is finite only where all its parts are.
    total = float(fix.p.sum() + fix.cov.sum() + fix.head.p.sum() + fix.head.q.sum())
    if not math.isfinite(total) or min(fix.cov[0, 0], fix.cov[1, 1], fix.cov[2, 2]) < 0.0:
        return Verdict.INVALID
    if fix.edge_px < LEAST_EDGE_PX:
        return Verdict.BORDER
    if fix.size_ratio is not None and not SIZE_RATIO[0] <= fix.size_ratio <= SIZE_RATIO[1]:
        return Verdict.SIZE
    return None


class Blob:
    """Where on the foot the depth camera's blob has its middle: halfway to the toes until both were seen together."""

    def __init__(self, foot: FootSettings) -> None:
        self.point: Array = 0.5 * np.array(foot.toe.p)
        """Foot frame, m."""
        self._n = 0

    @property
    def sigma(self) -> float:
        """m per axis."""
        return math.hypot(BLOB_SIGMA / math.sqrt(1.0 + self._n / BLOB_CORRELATED), BLOB_WANDER)

    def learn(self, ankle: Array, foot_q: Array, seen: Array) -> None:
        """A blob was seen at ``seen`` while the foot's pose was known by its tag."""
        offset = rot.unrotate(foot_q, seen - ankle) - self.point
        if float(offset @ offset) < (3.0 * BLOB_SIGMA) ** 2:
            self._n = min(self._n + 1, 600)
            self.point = self.point + offset / (BLOB_CORRELATED + self._n)


class FixRows:
    """Turns fixes into the timeline's rows for one shoe."""

    def __init__(self, foot: FootSettings, imu_p: Array, imu_q: Array, blob: Blob) -> None:
        self._target_to_sensor = rot.multiply(rot.conjugate(imu_q), np.array(foot.marker.q))
        self._sensor_to_target = rot.conjugate(self._target_to_sensor)
        self._arm = rot.unrotate(imu_q, np.array(foot.marker.p) - imu_p)
        self._imu_p, self._imu_q = imu_p, imu_q
        self._blob = blob

    def fill(self, row: Array, fix: OpticalFix, delay: float) -> list[Array]:
        """Write place and noise into ``row``; returns the sensor's attitudes that the tag allows, best first."""
        matrix = np.array(rotation(fix.head.q))
        row[POINT : POINT + 3] = fix.head.p + matrix @ fix.p
        distance2 = float(fix.p @ fix.p)
        noise = HEAD_NOISE**2 + HEAD_TURN_NOISE**2 * distance2
        row[ARM : ARM + 3] = self._arm
        if fix.kind == "depth":
            row[ARM : ARM + 3] = rot.unrotate(self._imu_q, self._blob.point - self._imu_p)
            noise += self._blob.sigma**2
        row[POINT_COV : POINT_COV + 9] = (matrix @ fix.cov @ matrix.T + noise * np.eye(3)).ravel()
        row[PLACED_DELAY] = delay
        found = []
        for q in (fix.q, fix.q_alt):
            norm = 0.0 if q is None else math.sqrt(float(q @ q))
            if q is not None and math.isfinite(norm) and norm > 0.0:
                found.append(rot.multiply(rot.multiply(fix.head.q, q / norm), self._sensor_to_target))
        return found

    def take_attitude(self, row: Array, fix: OpticalFix, attitudes: list[Array], x: Array) -> bool:
        """Let gravity, as the state ``x`` knows it, choose among the tag's attitudes.

        False: none of them can be this foot's. One that leans a little too much is just not used.
        """
        if not attitudes:
            return True
        leans = []
        for q in attitudes:
            error = attitude_error(q, x)
            leans.append(math.hypot(error[0], error[2]))
        best = int(np.argmin(leans))
        if leans[best] > TILT_IMPOSSIBLE:
            return False
        if leans[best] <= TILT_USABLE:
            q = attitudes[best]
            row[MEASURED_Q : MEASURED_Q + 4] = q
            target = np.array(rotation(rot.multiply(q, self._target_to_sensor)))
            row[NORMAL : NORMAL + 3] = target[:, 2]
            across = math.sqrt(max(0.0, float(np.linalg.eigvalsh(fix.cov)[0])))
            row[TURN_SIGMA] = math.hypot(LEAST_TURN_SIGMA, TURN_PER_METRE * across)
        return True


@compiled
def judged(row: Array, x: Array, P: Array, rate: Array) -> tuple[float, float, Vector]:
    """A fix against the state at its instant: squared Mahalanobis distances of place and of turn, residual (m)."""
    h, H, PH = np.empty(3), np.empty((3, NE)), np.empty((3, NE))
    point_model(x, row[ARM : ARM + 3], rate, x[16] - row[PLACED_DELAY], h, H)
    found, inverse = invert3(seen_through(P, H, row[POINT_COV : POINT_COV + 9].reshape(3, 3), PH))
    residual = (row[POINT] - h[0], row[POINT + 1] - h[1], row[POINT + 2] - h[2])
    y = turned(inverse, residual)
    place = residual[0] * y[0] + residual[1] * y[1] + residual[2] * y[2] if found else np.inf
    turn = 0.0
    if row[TURN_SIGMA] > 0.0:
        error = attitude_error(row[MEASURED_Q : MEASURED_Q + 4], x)
        variance, across = row[TURN_SIGMA] ** 2, 0.0
        for i in range(3):
            across += row[NORMAL + i] * error[i]
            for j in range(3):
                variance += row[NORMAL + i] * P[6 + i, 6 + j] * row[NORMAL + j]
        turn = across * across / variance
    return place, turn, residual
