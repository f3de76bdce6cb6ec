"""Bodies to send, and packets read by a parser that is not the sender's."""

from __future__ import annotations

from typing import Any, NamedTuple

import pytest

from foottrack_protocol.messages import BodyPose, FootPose, Pose
from foottrack_service.rotations import from_axis_angle, multiply, rotate

IDENTITY = (0.0, 0.0, 0.0, 1.0)


class Told(NamedTuple):
    """One OSC message: its address, type tags and values."""

    address: str
    tags: str
    values: list[Any]


def read(datagram: bytes) -> list[Told]:
    """By oscpy, which shares no code with python-osc."""
    parser = pytest.importorskip("oscpy.parser", reason="the third-party parser oscpy is not installed")
    return [
        Told(address.decode(), tags.decode(), [v.decode() if isinstance(v, bytes) else v for v in values])
        for address, tags, values, _ in parser.read_packet(datagram)
    ]


def foot(side: float, **changes: Any) -> FootPose:
    """A straight leg 0.1 m to a side (-1 left), that stands on a floor at 0."""
    x = 0.1 * side
    leg = {
        "hip": (x, 0.9, 0.0),
        "knee": (x, 0.5, 0.0),
        "ankle": Pose(p=(x, 0.1, 0.0), q=IDENTITY),
        "toe": (x, 0.02, -0.2),
        "v": (0.0, 0.0, 0.0),
        "contact": True,
        "stage": "marker",
        "sigma": 0.01,
        "age": 0.0,
    }
    return FootPose(**(leg | changes))


def standing(**changes: Any) -> BodyPose:
    """Upright at the stage's origin, looking along -Z."""
    body = {
        "head": Pose(p=(0.0, 1.7, -0.1), q=IDENTITY),
        "hips": Pose(p=(0.0, 0.95, 0.0), q=IDENTITY),
        "left": foot(-1.0),
        "right": foot(1.0),
    }
    return BodyPose(**(body | changes))


def turned(pose: BodyPose, axis: list[float], angle: float) -> BodyPose:
    """The whole body turned about the stage's origin, rad."""
    turn = from_axis_angle(axis, angle)

    def point(p: Any) -> tuple[float, ...]:
        return tuple(rotate(turn, p).tolist())

    def place(at: Any) -> Pose:
        return Pose(p=point(at.p), q=tuple(multiply(turn, at.q).tolist()))

    def limb(side: Any) -> FootPose:
        return side.model_copy(
            update={
                "hip": point(side.hip),
                "knee": point(side.knee),
                "toe": point(side.toe),
                "ankle": place(side.ankle),
            }
        )

    return BodyPose(head=place(pose.head), hips=place(pose.hips), left=limb(pose.left), right=limb(pose.right))
