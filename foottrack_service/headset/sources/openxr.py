"""OpenXR without pictures (``XR_MND_headless``; Monado, and SteamVR with it).

Latency: none to take off: the runtime gives the pose at the instant that it is asked for, which is the call's. Clock:
the runtime's time is converted from the counter that the bus clock reads (CLOCK_MONOTONIC, or Windows' performance
counter), so there is no offset to estimate.
"""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any

from foottrack_service.headset.rigid import Rigid, rigid
from foottrack_service.headset.settings import OpenXrSettings
from foottrack_service.headset.sources.polled import HeadsetError, Polled, Recentred


class OpenXrSource:
    """A headless session and its stage."""

    def __init__(self, settings: OpenXrSettings) -> None:
        """Raises HeadsetError: no package, no runtime, no headset, no headless sessions, or no stage."""
        self._xr = xr = _package()
        self._inferred = settings.inferred
        self._running = False
        self._changes: list[tuple[int, Recentred]] = []
        clock = (
            "XR_KHR_win32_convert_performance_counter_time"
            if sys.platform == "win32"
            else ("XR_KHR_convert_timespec_time")
        )
        try:
            self._instance = xr.create_instance(
                xr.InstanceCreateInfo(
                    enabled_extension_names=["XR_MND_headless", clock],
                    application_info=xr.ApplicationInfo(application_name="foottrack", api_version=xr.Version(1, 0, 0)),
                )
            )
        except xr.exception.XrException as error:
            raise HeadsetError(
                f"no OpenXR runtime with headless sessions answers ({type(error).__name__}): is it running?"
            ) from None
        try:
            self._to_xr_time = _converter(xr, self._instance)
            self._session = self._open_session()
            self._view, self._stage = self._space("VIEW"), self._space("STAGE")
        except xr.exception.XrException as error:
            xr.destroy_instance(self._instance)
            raise HeadsetError(
                f"the OpenXR runtime gives no session with a stage ({type(error).__name__}): headset, room setup?"
            ) from None

    def poll(self) -> Polled | None:
        """Ask now. Raises HeadsetError when the session ends."""
        xr = self._xr
        try:
            self._hear()
            if not self._running:
                return None
            t, at = self._to_xr_time()
            found = xr.locate_space(self._view, self._stage, at)
        except xr.exception.XrException as error:
            raise HeadsetError(f"the OpenXR runtime is gone: {type(error).__name__}") from None
        recentred = []
        while self._changes and self._changes[0][0] <= at:
            recentred.append(self._changes.pop(0)[1])
        return Polled(t, self._head(found), recentred)

    def close(self) -> None:
        """End the session."""
        try:
            self._xr.destroy_instance(self._instance)
        except self._xr.exception.XrException:
            return

    def _open_session(self) -> Any:
        xr = self._xr
        headset = xr.SystemGetInfo(form_factor=xr.FormFactor.HEAD_MOUNTED_DISPLAY)
        system = xr.get_system(self._instance, headset)
        return xr.create_session(self._instance, xr.SessionCreateInfo(system_id=system, next=None))

    def _space(self, name: str) -> Any:
        kind = getattr(self._xr.ReferenceSpaceType, name)
        info = self._xr.ReferenceSpaceCreateInfo(reference_space_type=kind)
        return self._xr.create_reference_space(self._session, info)

    def _head(self, found: Any) -> Rigid | None:
        flag = self._xr.SpaceLocationFlags
        wanted = flag.ORIENTATION_VALID_BIT | flag.POSITION_VALID_BIT
        if not self._inferred:
            wanted |= flag.ORIENTATION_TRACKED_BIT | flag.POSITION_TRACKED_BIT
        return _place(found.pose) if found.location_flags & wanted == wanted else None

    def _hear(self) -> None:
        xr = self._xr
        while True:
            try:
                event = xr.poll_event(self._instance)
            except xr.exception.EventUnavailable:
                return
            if event.type == xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED:
                self._on_state(xr.SessionState(_as(event, xr.EventDataSessionStateChanged).state))
            elif event.type == xr.StructureType.EVENT_DATA_REFERENCE_SPACE_CHANGE_PENDING:
                self._on_change(_as(event, xr.EventDataReferenceSpaceChangePending))
            elif event.type == xr.StructureType.EVENT_DATA_INSTANCE_LOSS_PENDING:
                raise HeadsetError("the OpenXR runtime quits")

    def _on_state(self, state: Any) -> None:
        xr = self._xr
        if state == xr.SessionState.READY:
            # What is shown to the eyes does not matter without pictures, but the call wants to know.
            xr.begin_session(self._session, xr.SessionBeginInfo(xr.ViewConfigurationType.PRIMARY_STEREO))
            self._running = True
        elif state == xr.SessionState.STOPPING:
            xr.end_session(self._session)
            self._running = False
        elif state in (xr.SessionState.EXITING, xr.SessionState.LOSS_PENDING):
            raise HeadsetError("the OpenXR runtime ended the session")

    def _on_change(self, event: Any) -> None:
        if event.reference_space_type == self._xr.ReferenceSpaceType.STAGE:
            old = _place(event.pose_in_previous_space) if event.pose_valid else None
            self._changes.append((int(event.change_time), Recentred(None if old is None else old.inverse())))


def _place(pose: Any) -> Rigid | None:
    """An XrPosef, whose axes are the wire's; None for one that a runtime says is valid and is not."""
    p, q = pose.position, pose.orientation
    try:
        return rigid((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
    except ValueError:
        return None


def _as(event: Any, kind: Any) -> Any:
    return ctypes.cast(ctypes.byref(event), ctypes.POINTER(kind)).contents


def _converter(xr: Any, instance: Any) -> Callable[[], tuple[int, int]]:
    """Says the bus time, ns, and the runtime's time, ns, of now."""
    if sys.platform == "win32":
        from xr.platform.windows import convert_win32_performance_counter_to_time_khr as convert

        counter = ctypes.c_int64()

        def now_windows() -> tuple[int, int]:
            before = time.perf_counter_ns()
            ctypes.windll.kernel32.QueryPerformanceCounter(ctypes.byref(counter))
            t = (before + time.perf_counter_ns()) // 2
            return t, _value(convert(instance, counter))

        return now_windows

    from xr.platform.linux import convert_timespec_time_to_time_khr, timespec

    def now_linux() -> tuple[int, int]:
        # perf_counter is CLOCK_MONOTONIC here, which is the clock that the extension converts from.
        t = time.perf_counter_ns()
        return t, _value(convert_timespec_time_to_time_khr(instance, timespec(t // 10**9, t % 10**9)))

    return now_linux


def _value(xr_time: Any) -> int:
    return int(getattr(xr_time, "value", xr_time))


def _package() -> ModuleType:
    try:
        import xr
        import xr.exception
    except (ImportError, OSError) as error:
        raise HeadsetError(f"OpenXR cannot be loaded ({error}): pip install 'foottrack[openxr]'") from None
    module: ModuleType = xr
    return module
