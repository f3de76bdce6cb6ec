"""Virtual Motion Tracker: trackers in SteamVR (https://gpsnmeajp.github.io/VirtualMotionTrackerDocument/api/).

``/VMT/Room/Unity index enable timeoffset x y z qx qy qz qw``: in SteamVR's room, Unity's axes. ``enable`` is 1 for a
tracker and 0 to switch it off.
"""

from __future__ import annotations

from foottrack_protocol.messages import BodyPose
from foottrack_service import unity_axes
from foottrack_service.bridges.osc import Osc, bundle
from foottrack_service.bridges.settings import VmtSettings
from foottrack_service.bridges.trackers import TRACKERS, Tracker, trackers

_ADDRESS = "/VMT/Room/Unity"
_OFF, _TRACKER = 0, 1
_NOWHERE = Tracker((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class Vmt:
    """One bundle for each pose. A tracker that was on and is lost is switched off, so that none is frozen in place."""

    def __init__(self, settings: VmtSettings) -> None:
        self._knees = settings.knees
        self._first = settings.first_index
        self._shown: set[str] = set()

    def datagrams(self, pose: BodyPose, t: int) -> list[bytes]:
        """See Bridge."""
        found = trackers(pose, self._knees)
        self._shown |= found.keys()
        return self._bundle(found)

    def farewell(self) -> list[bytes]:
        """See Bridge."""
        return self._bundle({})

    def _bundle(self, found: dict[str, Tracker]) -> list[bytes]:
        # Those that are off are said again each time: a datagram may be lost.
        messages = [
            self._message(name, found.get(name, _NOWHERE), _TRACKER if name in found else _OFF)
            for name in TRACKERS
            if name in self._shown
        ]
        return [bundle(messages)] if messages else []

    def _message(self, name: str, tracker: Tracker, enable: int) -> Osc:
        index = self._first + TRACKERS.index(name)
        return Osc(_ADDRESS, (index, enable, 0.0, *unity_axes.position(tracker.p), *unity_axes.rotation(tracker.q)))
