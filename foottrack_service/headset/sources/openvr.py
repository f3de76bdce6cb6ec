"""OpenVR (SteamVR, ALVR): the head, and trackers on the feet as truth.

Latency: none to take off: the runtime predicts each pose to the moment of the call. Clock: the bus clock's at the
middle of the call. Standing universe, whose axes are the wire's. When its place in the driver's own universe changes,
the stage was recentred, and by how much is known exactly.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from types import ModuleType
from typing import Any

import numpy as np

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.headset.rigid import Rigid, rigid
from foottrack_service.headset.settings import OpenVrSettings
from foottrack_service.headset.sources.polled import HeadsetError, Polled, Recentred

_LOOK_AGAIN_NS = 1_000_000_000
"""So often it is looked which device is which: they come and go."""

_log = logging.getLogger(__name__)


class OpenVrSource:
    """A background application: it does not start SteamVR, and ends with it."""

    def __init__(self, settings: OpenVrSettings, now: Callable[[], int], openvr: ModuleType | Any = None) -> None:
        """Raises HeadsetError: no package, no runtime, or it does not run. ``openvr`` is the package, or a double."""
        self._openvr = _package() if openvr is None else openvr
        self._now = now
        self._wanted: dict[Side, tuple[str, Rigid]] = {}
        ankles = (settings.ankle_left, settings.ankle_right)
        for side, serial, ankle in zip(SIDES, (settings.truth_left, settings.truth_right), ankles, strict=True):
            if serial:
                self._wanted[side] = (serial, rigid(ankle.p, ankle.q))
        try:
            self._system = self._openvr.init(self._openvr.VRApplication_Background)
        except self._openvr.error_code.OpenVRError as error:
            raise HeadsetError(f"SteamVR does not answer ({type(error).__name__}): is it running?") from None
        self._devices: dict[str, int] = {}
        self._missing: set[str] = set()
        self._looked: int | None = None
        self._standing: Rigid | None = None

    def poll(self) -> Polled:
        """Ask now. Raises HeadsetError when SteamVR quits."""
        self._hear()
        before = self._now()
        standing, poses = self._ask()
        t = (before + self._now()) // 2
        if self._wanted and (self._looked is None or t - self._looked > _LOOK_AGAIN_NS):
            self._looked = t
            self._look()
        truth: dict[Side, Rigid] = {}
        for side, (serial, ankle) in self._wanted.items():
            index = self._devices.get(serial)
            tracker = None if index is None else self._pose(poses[index])
            if tracker is not None:
                truth[side] = tracker.then(ankle)
        recentred = []
        if self._standing is not None and not _same(standing, self._standing):
            recentred.append(Recentred(standing.then(self._standing.inverse())))
        self._standing = standing
        head = self._pose(poses[self._openvr.k_unTrackedDeviceIndex_Hmd])
        return Polled(t, head, recentred, truth)

    def close(self) -> None:
        """Let SteamVR go."""
        self._openvr.shutdown()

    def _ask(self) -> tuple[Rigid, Any]:
        """How the standing universe lies in the driver's, and poses in that very one. Raises HeadsetError."""
        vr = self._openvr
        standing = self._standing_place()
        while True:
            poses = self._system.getDeviceToAbsoluteTrackingPose(vr.TrackingUniverseStanding, 0.0, None)
            after = self._standing_place()
            if _same(standing, after):
                return standing, poses
            standing = after

    def _standing_place(self) -> Rigid:
        try:
            return place_of(self._system.getRawZeroPoseToStandingAbsoluteTrackingPose())
        except ValueError:
            raise HeadsetError("SteamVR has no place for its standing universe: run its room setup") from None

    def _pose(self, pose: Any) -> Rigid | None:
        """None for what is not tracked: out of range the runtime repeats the last place or makes one up."""
        good = pose.bDeviceIsConnected and pose.bPoseIsValid
        if not good or pose.eTrackingResult != self._openvr.TrackingResult_Running_OK:
            return None
        try:
            return place_of(pose.mDeviceToAbsoluteTracking)
        except ValueError:
            return None

    def _hear(self) -> None:
        event = self._openvr.VREvent_t()
        while self._system.pollNextEvent(event):
            if event.eventType == self._openvr.VREvent_Quit:
                self._system.acknowledgeQuit_Exiting()
                raise HeadsetError("SteamVR quits")

    def _look(self) -> None:
        vr = self._openvr
        found: dict[str, int] = {}
        for index in range(vr.k_unMaxTrackedDeviceCount):
            if self._system.isTrackedDeviceConnected(index):
                # It may go between the two calls.
                with suppress(vr.error_code.OpenVRError):
                    found[self._system.getStringTrackedDeviceProperty(index, vr.Prop_SerialNumber_String)] = index
        missing = {serial for serial, _ in self._wanted.values() if serial not in found}
        for serial in sorted(missing - self._missing):
            _log.warning("no device %s; there are: %s", serial, ", ".join(sorted(found)) or "none")
        self._devices, self._missing = found, missing


def place_of(matrix: Any) -> Rigid:
    """An HmdMatrix34_t: rotation and place, right-handed, +Y up, -Z forward, as the wire has them.

    Raises ValueError where it is neither.
    """
    m = np.array([[matrix.m[row][column] for column in range(4)] for row in range(3)], dtype=np.float64)
    return rigid(m[:, 3], rotations.from_matrix(m[:, :3]))


def _same(a: Rigid, b: Rigid) -> bool:
    return bool(np.allclose(a.p, b.p, atol=1e-5) and rotations.angle_between(a.q, b.q) < 1e-4)


def _package() -> ModuleType:
    try:
        import openvr
    except ImportError as error:
        raise HeadsetError(f"OpenVR cannot be loaded ({error}): pip install 'foottrack[openvr]'") from None
    module: ModuleType = openvr
    return module
