"""By how much a camera's depths are too long, compiled: a foot that stands is on the floor, and its tag is above it.

A depth camera's scale is off by some tenths of a per cent: 5 mm from a head down to a shoe, the same in every picture,
so no number of them takes it away. The floor knows as much as the camera, and errs otherwise: both are weighed here
once, and not picture by picture, where the camera would always have the last word.
"""

from __future__ import annotations

from foottrack_service.compiled import compiled
from foottrack_service.fusion.compiled_rotations import quaternion, rotation, squared, turned, vector
from foottrack_service.fusion.foot_filter_memory import Foot
from foottrack_service.fusion.foot_filter_replay import FLOOR_LEAN, FLOOR_SIGMA
from foottrack_service.rotations import Array

SCALE_SIGMA = 0.005
"""How wrong depth scales are, SD (mount_filter has the same)."""
PICTURE_SIGMA = 0.005
"""What one picture adds to that, SD: its noise and its share of what neighbours have in common."""
PICTURES = 1200.0
"""So many are remembered: 20 s of them, as carpets and stairs are walked over."""
LEAST_DROP = 0.5
"""m: who is no higher above the floor than this learns little about a scale."""
GATE = 9.0
"""Chi-square, 1 degree of freedom: a sole that seems further off the floor stands on something else."""

# range, shape (3,): how many pictures, their mean scale, and what of it is believed
SEEN, MEAN, SCALE = 0, 1, 2


@compiled
def learn_range(s: Foot, x: Array) -> None:
    """A marker, as it lies in the foot's memory, was seen on a foot that stands; ``x``, shape (17,), is its filter."""
    R = rotation(quaternion(x, 6))
    up = turned(R, vector(s.foot_up, 0))[1]
    head = rotation(quaternion(s.head_q, 0))[1]
    drop = -(head[0] * s.p[0] + head[1] * s.p[1] + head[2] * s.p[2])
    tag = turned(R, vector(s.marker_arm, 0))[1] - turned(R, vector(s.ankle_arm, 0))[1]
    above = s.head_p[1] - s.floor - tag
    # Without a floor ``above`` is no number, and above nothing.
    if not (up > FLOOR_LEAN and drop > LEAST_DROP and above > LEAST_DROP):
        return
    scale = drop / above - 1.0
    floor2, scale2 = squared(FLOOR_SIGMA / drop), SCALE_SIGMA * SCALE_SIGMA
    if not scale * scale < GATE * (floor2 + scale2):
        return
    known = s.range[:]
    known[SEEN] = min(known[SEEN] + 1.0, PICTURES)
    known[MEAN] += (scale - known[MEAN]) / known[SEEN]
    known[SCALE] = known[MEAN] * scale2 / (scale2 + floor2 + PICTURE_SIGMA * PICTURE_SIGMA / known[SEEN])
