"""All that compiled code knows of one foot, in one block of memory: a call passes it in a fifth of a microsecond.

Compiled code gets an array of one record of FOOT; Python sees the same memory through the array's fields.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from foottrack_service.compiled import compiling_is_off
from foottrack_service.fusion.foot_filter_events import COLUMNS
from foottrack_service.fusion.foot_filter_kernel import NE, NX

KEPT = 640
"""Events that are surely kept: 1 s at 400 Hz with two fixes per picture at 60 fps, and some."""
SEEN_KEPT = 64
MARKER, DEPTH = 0, 1

FOOT = np.dtype(
    [
        # The timeline (timeline.py): events 0 .. n - 1, the state and covariance after each.
        ("n", np.int64),
        ("t", np.int64, 2 * KEPT),
        ("rows", np.float64, (2 * KEPT, COLUMNS)),
        ("X", np.float64, (2 * KEPT, NX)),
        ("P", np.float64, (2 * KEPT, NE, NE)),
        # The newest sample: its stamp, its row, its q (zeros without one); the specific force of the last two, and its
        # largest component, which fades; how many have come from the past since; how much a device has been moved
        # lately (foot_filter_sample.py).
        ("newest", np.int64),
        ("last", np.float64, COLUMNS),
        ("last_q", np.float64, 4),
        ("forces", np.float64, (2, 3)),
        ("strongest", np.float64),
        ("behind", np.int64),
        ("effort", np.float64),
        # Stance (contact.py), and what is held of a foot that stands (foot_filter_output.py).
        ("stance", np.float64, 6),
        ("rest", np.float64, 8),
        ("lock", np.float64, 9),
        # Whether fixes have said where the foot is, and not too long ago; the last few accepted ones, oldest first, and
        # how fast they move, m/s.
        ("acquired", np.int64),
        ("seen", np.int64),
        ("seen_t", np.int64, SEEN_KEPT),
        ("seen_p", np.float64, (SEEN_KEPT, 3)),
        ("seen_speed", np.float64),
        # When a tag was last accepted, and by how much the camera's depths are too long (foot_filter_range.py).
        ("tag_t", np.int64),
        ("range", np.float64, 3),
        # The newest fix: its event, and how far it is from where it was expected, m.
        ("fix_at", np.int64),
        ("residual", np.float64, 3),
        # The shoe, in the sensor's frame: m, unit vectors and quaternions. ``floor``: height of a standing ankle in the
        # stage, NaN without a floor.
        ("ankle_arm", np.float64, 3),
        ("ball_arm", np.float64, 3),
        ("sole_arm", np.float64, 3),
        ("foot_up", np.float64, 3),
        ("foot_to_sensor", np.float64, 4),
        ("marker_arm", np.float64, 3),
        ("sensor_to_marker", np.float64, 4),
        ("blob_arm", np.float64, 3),
        ("blob_sigma", np.float64),
        ("floor", np.float64),
        # What is handed over with a call: a sample, or a fix with the head that saw it.
        ("acc", np.float64, 3),
        ("gyro", np.float64, 3),
        ("q", np.float64, 4),
        ("p", np.float64, 3),
        ("q_alt", np.float64, 4),
        ("cov", np.float64, (3, 3)),
        ("head_p", np.float64, 3),
        ("head_q", np.float64, 4),
    ],
    align=True,
)

Feet = npt.NDArray[np.void]
"""An array of one record of FOOT: what Python passes."""
Foot = Any
"""The record itself, within compiled code."""


def new_foot() -> Feet:
    """The memory of a foot of which nothing is known."""
    foot = np.zeros(1, FOOT)
    foot["forces"][0, 1] = 1.0  # like no sample's, and unlike the other's
    foot["tag_t"] = -(2**62)
    # Where nothing is compiled Python has to find a record's fields by name. (Such an array costs a call 3 us.)
    return foot.view(np.recarray) if compiling_is_off() else foot
