"""Messages that the tests of the clients send."""

from __future__ import annotations

from typing import Any

from foottrack_client import Endpoints
from foottrack_protocol import Message, encode
from foottrack_protocol.messages import BodyPose, FootPose, GaitEvent, Pose

FINAL_STEP = 424242
"""The gait event "stop" with this step tells a client under test to end."""
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def step(number: int) -> GaitEvent:
    """An event that must not be lost."""
    return GaitEvent(side="left", event="foot_strike", step=number)


FINAL = GaitEvent(event="stop", step=FINAL_STEP)


def foot(x: float, ankle_y: float = 0.09, z: float = 0.0, **changes: Any) -> FootPose:
    """A standing foot below its hip; legs of 0.4 and 0.42 m."""
    values: dict[str, Any] = {
        "hip": (x, 0.9, 0.0),
        "knee": (x, 0.5, -0.05),
        "ankle": Pose(p=(x, ankle_y, z), q=UPRIGHT),
        "toe": (x, 0.02, z - 0.19),
        "v": (0.0, 0.0, 0.0),
        "contact": True,
        "stage": "marker",
        "sigma": 0.005,
    }
    return FootPose(**{**values, **changes})


POSE = BodyPose(left=foot(-0.1), right=foot(0.1))


def frames(stream: str, data: Any, seq: int = 0, **changes: Any) -> tuple[bytes, bytes]:
    """The two frames of a message of `user`."""
    values = {"user": "user", "src": "test", "sid": "5d41402a", "t": 0, "t_pub": 0, "valid": True, **changes}
    return encode(Message(stream=stream, seq=seq, data=data, **values))


def ports(endpoints: Endpoints) -> dict[str, int]:
    """As the Godot client takes them."""
    return {name: int(endpoint.rpartition(":")[2]) for name, endpoint in endpoints._asdict().items()}
