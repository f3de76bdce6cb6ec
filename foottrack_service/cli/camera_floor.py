"""``foottrack calibrate floor-by-depth``: depth pictures and head poses of the same instants."""

from __future__ import annotations

import numpy as np

from foottrack_protocol.messages import FloorCalibration as FloorMessage
from foottrack_protocol.messages import FloorValues
from foottrack_service.bus.connection import Bus
from foottrack_service.bus.subscriber import Subscriber
from foottrack_service.camera.floor import FloorCalibration, FloorError, Plane, calibrate_floor, find_floor
from foottrack_service.camera.frame import Source, SourceEnded, SourceError
from foottrack_service.camera.setup import rig_of
from foottrack_service.config import Settings
from foottrack_service.fusion.head_history import HeadHistory
from foottrack_service.fusion.interface import HeadSample
from foottrack_service.rotations import Array

_PATIENCE = 4
"""So many pictures may be without floor or head pose for each that is used."""


def measure_floor(settings: Settings, source: Source, pictures: int) -> FloorCalibration:
    """Collect, compute, publish; closes the source. Raises FloorError, SourceError, NotReady."""
    rig = rig_of(settings.camera, source.intrinsics)
    heads = HeadHistory()
    waiting: list[tuple[int, Plane]] = []
    planes: list[Plane] = []
    poses: list[tuple[Array, Array]] = []
    last: Plane | None = None
    with Bus.connect(settings.bus) as bus:
        try:
            subscriber = bus.subscriber([f"{settings.user}/head/pose"])
            subscriber.wait_ready()
            for _ in range(_PATIENCE * pictures):
                frame = source.read()
                if frame.depth is None:
                    raise FloorError("this camera has no depth")
                last = find_floor(frame, source.intrinsics, last)
                if last is not None:
                    waiting.append((frame.t, last))
                _take_heads(subscriber, heads)
                # A picture's head pose is known once a later one has come.
                for t, plane in list(waiting):
                    head = heads.at(t)
                    if head is not None:
                        waiting.remove((t, plane))
                        planes.append(plane)
                        poses.append((head.p, head.q))
                if len(planes) >= pictures:
                    break
        except (SourceEnded, SourceError) as error:
            raise FloorError(str(error)) from error
        finally:
            source.close()
        found = calibrate_floor(planes, poses, rig)
        publisher = bus.publisher("calibration")
        publisher.wait_ready()
        publisher.publish(
            settings.user, "calibration", bus.clock(), FloorMessage(values=FloorValues(height=found.height))
        )
    return found


def _take_heads(subscriber: Subscriber, heads: HeadHistory) -> None:
    while batch := subscriber.drain():
        for received in batch:
            message = received.message
            if not message.valid or not message.data.tracked:
                heads.add_untracked(message.t)
            else:
                heads.add(HeadSample(message.t, np.array(message.data.p), np.array(message.data.q)))
