"""VRChat's OSC trackers (https://docs.vrchat.com/docs/osc-trackers).

Three floats each: a position in metres, and Unity's Euler angles in degrees, applied in the order Z, X, Y. VRChat finds
out at its calibration which tracker is on which part of the body. The head's position shifts VRChat's tracking space
until it is where the avatar's head bone begins; of its rotation the yaw counts.
"""

from __future__ import annotations

import numpy as np

from foottrack_protocol.messages import BodyPose
from foottrack_service import unity_axes
from foottrack_service.bridges.osc import Osc, message
from foottrack_service.bridges.settings import VrchatSettings
from foottrack_service.bridges.trackers import TRACKERS, Tracker, trackers
from foottrack_service.rotations import rotate


class Vrchat:
    """One datagram for each address."""

    def __init__(self, settings: VrchatSettings) -> None:
        self._settings = settings

    def datagrams(self, pose: BodyPose, t: int) -> list[bytes]:
        """See Bridge."""
        found = trackers(pose, self._settings.knees)
        places = {str(1 + TRACKERS.index(name)): tracker for name, tracker in found.items()}
        if self._settings.head and pose.head is not None:
            joint = np.asarray(pose.head.p) + rotate(pose.head.q, self._settings.head_joint)
            places["head"] = Tracker(joint, pose.head.q)
        sent = []
        for place, tracker in places.items():
            address = f"/tracking/trackers/{place}"
            sent.append(message(Osc(f"{address}/position", unity_axes.position(tracker.p))))
            sent.append(message(Osc(f"{address}/rotation", unity_axes.euler(tracker.q))))
        return sent

    def farewell(self) -> list[bytes]:
        """See Bridge; VRChat knows none."""
        return []
