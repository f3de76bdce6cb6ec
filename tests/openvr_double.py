"""An OpenVR runtime made of plain values: what the source reads of the package, and nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from foottrack_service import rotations
from foottrack_service.headset.rigid import NOWHERE, Rigid

RUNNING_OK, OUT_OF_RANGE = 200, 201


class OpenVRError(Exception):
    """The package's base of errors."""


class Runtime:
    """The package and its system in one. ``devices`` are (serial, place in the driver's universe, result)."""

    VRApplication_Background = 3
    TrackingUniverseStanding = 1
    TrackingResult_Running_OK = RUNNING_OK
    VREvent_Quit = 700
    Prop_SerialNumber_String = 1002
    k_unTrackedDeviceIndex_Hmd = 0  # noqa: N815
    k_unMaxTrackedDeviceCount = 64  # noqa: N815
    error_code = SimpleNamespace(OpenVRError=OpenVRError)

    def __init__(self, *devices: tuple[str, Rigid, int]) -> None:
        self.devices = list(devices)
        self.standing = NOWHERE
        self.events: list[int] = []
        self.told: list[str] = []
        self.running = True
        self.nameless: int | None = None
        """A device that is gone when it is asked for its name."""

    def init(self, application: int) -> Runtime:
        assert application == self.VRApplication_Background
        if not self.running:
            raise OpenVRError
        return self

    def shutdown(self) -> None:
        self.told.append("shutdown")

    def VREvent_t(self) -> Any:
        return SimpleNamespace(eventType=0)

    def pollNextEvent(self, event: Any) -> bool:
        if self.events:
            event.eventType = self.events.pop(0)
            return True
        return False

    def acknowledgeQuit_Exiting(self) -> None:
        self.told.append("exiting")

    def getRawZeroPoseToStandingAbsoluteTrackingPose(self) -> Any:
        return matrix(self.standing)

    def getDeviceToAbsoluteTrackingPose(self, universe: int, seconds: float, into: Any) -> list[Any]:
        assert (universe, seconds) == (self.TrackingUniverseStanding, 0.0)
        poses = [
            SimpleNamespace(
                mDeviceToAbsoluteTracking=matrix(self.standing.then(place)),
                bPoseIsValid=True,
                bDeviceIsConnected=True,
                eTrackingResult=result,
            )
            for _, place, result in self.devices
        ]
        nobody = SimpleNamespace(bPoseIsValid=False, bDeviceIsConnected=False, eTrackingResult=1)
        return poses + [nobody] * (self.k_unMaxTrackedDeviceCount - len(poses))

    def isTrackedDeviceConnected(self, index: int) -> bool:
        return index < len(self.devices)

    def getStringTrackedDeviceProperty(self, index: int, prop: int) -> str:
        assert prop == self.Prop_SerialNumber_String
        if index == self.nameless:
            raise OpenVRError
        return self.devices[index][0]


def matrix(place: Rigid) -> Any:
    return SimpleNamespace(m=np.column_stack([rotations.to_matrix(place.q), place.p]).tolist())
