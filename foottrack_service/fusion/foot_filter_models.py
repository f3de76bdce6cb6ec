"""What a fix measures: the models of a foot's point and attitude, and the updates by an accepted fix, compiled."""

from __future__ import annotations

import numpy as np

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import (
    Quaternion,
    Vector,
    conjugate,
    cross,
    logarithm,
    product,
    quaternion,
    rotation,
    squared,
    turned,
    vector,
)
from foottrack_service.fusion.foot_filter_events import (
    ACCEPTED,
    ARM,
    FACE,
    MEASURED_Q,
    PLACED_DELAY,
    PLACES,
    POINT,
    POINT_COV,
    TURN_SIGMA,
)
from foottrack_service.fusion.foot_filter_kernel import NE, update1, update3
from foottrack_service.rotations import Array

TILT_UNKNOWN, TAG_TILT_SIGMA = 0.1, 0.25
"""rad: a foot that knows its tilt no better, after a silence, takes the tag's; its pictures err alike."""


@compiled
def point_model(x: Array, arm: Vector, rate: Vector, delay: float, h: Array, H: Array) -> None:
    """A point of the foot at ``arm``, sensor frame, m: its place into h (3,), the Jacobian into H (3, 16).

    ``rate`` is the sensor's turning, rad/s; ``delay`` how much later than the state the point was seen, s.
    """
    R = rotation(quaternion(x, 6))
    r = turned(R, arm)
    s = turned(R, cross(rate, arm))
    H[:] = 0.0
    for i in range(3):
        speed = x[3 + i] + s[i]
        h[i] = x[i] + r[i] + speed * delay
        H[i, i] = 1.0
        H[i, 3 + i] = delay
        H[i, 15] = speed
    H[0, 7], H[0, 8] = r[2], -r[1]
    H[1, 6], H[1, 8] = -r[2], r[0]
    H[2, 6], H[2, 7] = r[1], -r[0]


@compiled
def attitude_error(q: Quaternion, x: Array) -> Vector:
    """The small turn in the stage from the state's attitude to q, rotation vector, rad."""
    return logarithm(product(q, conjugate(quaternion(x, 6))))


@compiled
def turn_off(row: Array, x: Array) -> tuple[Vector, float]:
    """The tag's normal in the stage by the state, and the turn about it from the state's attitude to the seen one, rad.

    The seen normal is off by degrees, another way in each picture: taken for the axis, it makes every picture of a foot
    that stands tell a bit of its tilt, and a second of them what nobody can know.
    """
    normal = turned(rotation(quaternion(x, 6)), vector(row, FACE))
    error = attitude_error(quaternion(row, MEASURED_Q), x)
    return normal, normal[0] * error[0] + normal[1] * error[1] + normal[2] * error[2]


@compiled
def fix_updates(row: Array, x: Array, P: Array, rate: Vector) -> None:
    """An accepted fix: the target's place and, where it has one, its turn about the target's face."""
    h, H = np.empty(3), np.empty((3, NE))
    point_model(x, vector(row, ARM), rate, x[16] - row[PLACED_DELAY], h, H)
    if row[ACCEPTED] == PLACES:
        H[:, 15] = 0.0
    noise = row[POINT_COV : POINT_COV + 9].reshape(3, 3)
    update3(x, P, H, (row[POINT] - h[0], row[POINT + 1] - h[1], row[POINT + 2] - h[2]), noise, np.inf)
    if row[TURN_SIGMA] > 0.0:
        normal, innovation = turn_off(row, x)
        H1 = np.zeros(NE)
        for i in range(3):
            H1[6 + i] = normal[i]
        update1(x, P, H1, innovation, squared(row[TURN_SIGMA]), np.inf)
        if P[6, 6] + P[8, 8] > TILT_UNKNOWN**2:
            for k in (6, 8):
                H1[:] = 0.0
                H1[k] = 1.0
                error = attitude_error(quaternion(row, MEASURED_Q), x)
                update1(x, P, H1, error[k - 6], TAG_TILT_SIGMA**2, np.inf)
