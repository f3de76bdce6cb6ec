"""Where the hips are, given head and feet: a trunk that leans, legs that crouch.

In plain floats, as it runs for every pose on its way to an engine.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from foottrack_protocol.messages import Side
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.body.vectors import Quaternion, Vec, add, along, norm, sub, turned, unit

REACH = 0.99
"""A leg is never straighter than this share of its length, so that a knee always has a direction to bend to."""
HIPS_BEFORE_ANKLES = 0.03
"""m, of a person who stands upright: the weight is over the middle of the feet."""

# The hips go back while the trunk leans forward by 1 m, and while the legs shorten by 1 m, m. Balance of the segments'
# masses (Winter, table 4.1: head, arms and trunk 0.678 of the mass at 0.44 of the way from hips to eyes, thighs 0.2,
# shanks 0.093) gives 0.38 and 0.1; people who squat sit further back than it demands.
_BACK_PER_LEAN = 0.40
_BACK_PER_CROUCH = 0.2
_WALKING_DROP = 0.03
"""m: so far the neck sinks in a step, or with a look down."""
_ROUNDS = 4


class Facing(NamedTuple):
    """Horizontal axes of a body with a yaw, and that turn as a quaternion."""

    forward: Vec
    right: Vec
    q: Quaternion

    @classmethod
    def of(cls, yaw: float) -> Facing:
        """From a yaw, rad."""
        sine, cosine = math.sin(yaw), math.cos(yaw)
        return cls((-sine, 0.0, -cosine), (cosine, 0.0, -sine), (0.0, math.sin(0.5 * yaw), 0.0, math.cos(0.5 * yaw)))


class Hips(NamedTuple):
    """Hips' centre [m], their rotation to the stage (they pitch with the trunk), and the hip joint of each foot [m]."""

    p: Vec
    q: Quaternion
    joints: dict[Side, Vec]


def neck(head_p: Sequence[float], head_q: Sequence[float], body: Skeleton) -> Vec:
    """The point that the head nods about, m: so a look down does not lower the hips."""
    x, y, z = turned(head_q, (0.0, -body.neck_down, body.neck_back))
    return (head_p[0] + x, head_p[1] + y, head_p[2] + z)


def hips_below(top: Vec, facing: Facing, ankles: Mapping[Side, Vec], body: Skeleton) -> tuple[Vec, float]:
    """Hips' centre [m] below the neck, and how far the trunk leans forward [rad] against its upright pose.

    The trunk keeps its length. With both feet, a neck that is ahead of where it would be over them leans, as far as
    its drop allows, and the rest of the drop is the legs'; with fewer feet nothing tells a lean from a crouch.
    """
    rise, ahead = body.torso - body.neck_down, body.hip_back - body.neck_back
    lean = _lean(top, facing, ankles, body, rise, ahead) if len(ankles) == 2 else 0.0
    length = math.hypot(rise, ahead)
    over = min(ahead + lean, 0.999 * length)
    hips = along(top, facing.forward, -over)
    pitch = math.asin(over / length) - math.atan2(ahead, rise)
    return (hips[0], top[1] - math.sqrt(length * length - over * over), hips[2]), pitch


def place(hips: Vec, pitch: float, facing: Facing, ankles: Mapping[Side, Vec], body: Skeleton) -> Hips:
    """Hips from which both feet are within reach: as given, or lowered and shifted no further than needed.

    ``pitch`` is the trunk's lean, rad. Feet too far apart for it get the nearest to it that there is.
    """
    offsets: dict[Side, Vec] = {
        side: along((0.0, 0.0, 0.0), facing.right, (0.5 if side == "right" else -0.5) * body.hip_width)
        for side in ankles
    }
    centres = [sub(ankle, offsets[side]) for side, ankle in ankles.items()]
    hips = _apart(_near(hips, centres, REACH * (body.thigh + body.shank)), centres, body)
    sine, cosine = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    _, y, _, w = facing.q
    q = (-w * sine, y * cosine, y * sine, w * cosine)
    return Hips(hips, q, {side: add(hips, offset) for side, offset in offsets.items()})


def _lean(top: Vec, facing: Facing, ankles: Mapping[Side, Vec], body: Skeleton, rise: float, ahead: float) -> float:
    # Lean and crouch, m, from how far the neck is ahead of the front foot and how far it is down. A step or a sway is
    # neither: it moves the hips as well, and hardly lowers the neck.
    fx, _, fz = facing.forward
    front = max(x * fx + z * fz for x, _, z in ankles.values())
    lowest = min(y for _, y, _ in ankles.values())
    out = top[0] * fx + top[2] * fz - front - HIPS_BEFORE_ANKLES - ahead
    drop = lowest + REACH * (body.thigh + body.shank) + rise - top[1] - _WALKING_DROP
    if drop <= 0.0:
        return 0.0
    drop = min(drop, rise)
    most = math.sqrt(rise * rise - (rise - drop) * (rise - drop))
    lean, crouch = 0.0, drop
    for _ in range(_ROUNDS):
        lean = min(max((out + _BACK_PER_CROUCH * crouch) / (1.0 - _BACK_PER_LEAN), 0.0), most)
        crouch = drop - (rise - math.sqrt(rise * rise - lean * lean))
    return lean


def _near(hips: Vec, centres: Sequence[Vec], reach: float) -> Vec:
    # The nearest point of the intersection of balls with one radius round each centre: on a ball's surface, or else on
    # the circle where two meet, or else, where they do not, in the middle.
    beyond = [centre for centre in centres if norm(sub(hips, centre)) > reach]
    if not beyond:
        return hips
    for centre in beyond:
        pulled = along(centre, unit(sub(hips, centre), (0.0, 1.0, 0.0)), reach)
        if all(norm(sub(pulled, other)) <= reach for other in centres if other is not centre):
            return pulled
    first, second = centres
    middle = (0.5 * (first[0] + second[0]), 0.5 * (first[1] + second[1]), 0.5 * (first[2] + second[2]))
    between = sub(second, first)
    half = 0.5 * norm(between)
    if half >= reach:
        return middle
    axis = unit(between, (1.0, 0.0, 0.0))
    out = sub(hips, middle)
    share = out[0] * axis[0] + out[1] * axis[1] + out[2] * axis[2]
    across = unit(along(out, axis, -share), (0.0, 1.0, 0.0))
    return along(middle, across, math.sqrt(reach * reach - half * half))


def _apart(hips: Vec, centres: Collection[Vec], body: Skeleton) -> Vec:
    # A foot nearer to its hip joint than thigh and shank differ would stretch them as well.
    least = abs(body.thigh - body.shank) * 1.001 + 1e-6
    for centre in centres:
        if norm(sub(hips, centre)) < least:
            hips = along(centre, unit(sub(hips, centre), (0.0, 1.0, 0.0)), least)
    return hips
