"""Intel RealSense: colour with depth aligned to it, stamped by the device.

`FramesetReader` turns one set of pictures into a Frame and knows no pipeline, so that librealsense's software device
exercises it without a camera.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from foottrack_service.camera.frame import Frame, Gray, SourceError
from foottrack_service.camera.rig import Intrinsics
from foottrack_service.camera.settings import RealSenseSettings

_TIMEOUT_MS = 1000


class FramesetReader:
    """Filters, aligns and stamps. `now` and `unix` are the bus clock and Unix time, ns."""

    def __init__(
        self,
        settings: RealSenseSettings,
        exposure: float,
        now: Callable[[], int] = time.perf_counter_ns,
        unix: Callable[[], int] = time.time_ns,
    ) -> None:
        self._rs = _library()
        self._exposure, self._readout = exposure, settings.readout
        self._now, self._unix = now, unix
        self._align = self._rs.align(self._rs.stream.color)
        self._filters: list[Any] = []
        if settings.decimation > 1:
            self._filters.append(self._rs.decimation_filter(settings.decimation))
        if settings.spatial:
            self._filters.append(self._rs.spatial_filter())
        if settings.temporal:
            self._filters.append(self._rs.temporal_filter())
        self._offset: int | None = None

    def frame(self, frameset: Any) -> Frame | None:
        """A Frame of a whole set; None where colour is missing."""
        arrival = self._now()
        # Filters before alignment: afterwards depth has gaps that are none of the surface's.
        for step in self._filters:
            frameset = step.process(frameset).as_frameset()
        aligned = self._align.process(frameset)
        colour, depth = aligned.get_color_frame(), aligned.get_depth_frame()
        if not colour:
            return None
        exposure = self._metadata(colour, "actual_exposure")
        # librealsense counts colour exposure in 100 us on UVC cameras, but metadata in us.
        seconds = self._exposure if exposure is None else exposure * 1e-6
        return Frame(
            gray=_gray(colour, self._rs),
            depth=np.array(depth.get_data(), dtype=np.uint16) if depth else None,
            t=self._mid_exposure(colour, arrival, seconds),
            number=int(colour.get_frame_number()),
            exposure=seconds,
            readout=self._readout,
            depth_unit=float(depth.get_units()) if depth else 0.001,
        )

    def _mid_exposure(self, colour: Any, arrival: int, exposure: float) -> int:
        domain = colour.get_frame_timestamp_domain()
        stamp = round(float(colour.get_timestamp()) * 1e6)
        sent, middle = self._metadata(colour, "frame_timestamp"), self._metadata(colour, "sensor_timestamp")
        # Device stamps are taken when readout begins to be sent, unless the sensor's own mid-exposure is known.
        early = (sent - middle) * 1000 if sent is not None and middle is not None else None
        if early is None or not 0 <= early < 100_000_000:
            early = round((0.5 * exposure + 0.5 * self._readout) * 1e9)
        if domain == self._rs.timestamp_domain.global_time:
            return stamp - self._unix() + self._now() - early
        if domain == self._rs.timestamp_domain.hardware_clock:
            # The shortest way ever seen maps the device's clock; it leaks by 20 us/s to follow its drift.
            offset = arrival - stamp
            leaked = offset if self._offset is None else self._offset + 333
            # It counts us in 32 bits: after 71 minutes it begins again. No picture is on its way for so long.
            self._offset = offset if offset - leaked > _TIMEOUT_MS * 1_000_000 else min(offset, leaked)
            return stamp + self._offset - early
        return arrival - early

    def _metadata(self, frame: Any, name: str) -> int | None:
        value = getattr(self._rs.frame_metadata_value, name)
        return int(frame.get_frame_metadata(value)) if frame.supports_frame_metadata(value) else None


class RealSenseSource:
    """A camera that is plugged in."""

    def __init__(self, settings: RealSenseSettings, exposure: float) -> None:
        """Raises SourceError when there is none, or it cannot do what is asked."""
        rs = _library()
        self._reader = FramesetReader(settings, exposure)
        serials = [device.get_info(rs.camera_info.serial_number) for device in rs.context().query_devices()]
        # Starting a pipeline without a camera would wait for one for 15 s.
        if not serials or (settings.serial and settings.serial not in serials):
            there = ", ".join(serials) or "none"
            raise SourceError(f"no RealSense {settings.serial}".rstrip() + f" is plugged in (found: {there})")
        self._pipeline = rs.pipeline()
        config = rs.config()
        if settings.serial:
            config.enable_device(settings.serial)
        size = (settings.width, settings.height)
        config.enable_stream(rs.stream.color, *size, rs.format.rgb8, settings.fps)
        config.enable_stream(rs.stream.depth, *size, rs.format.z16, settings.fps)
        try:
            profile = self._pipeline.start(config)
        except RuntimeError as error:
            wanted = f"{size[0]}x{size[1]} at {settings.fps}/s"
            raise SourceError(
                f"no RealSense does colour and depth of {wanted}: {error} (USB 3 port and cable?)"
            ) from error
        stream = profile.get_stream(rs.stream.color).as_video_stream_profile()
        self.intrinsics = lens_of(stream.get_intrinsics())
        for sensor in profile.get_device().query_sensors():
            _set_exposure(rs, sensor, exposure)

    def read(self) -> Frame:
        """The next picture. Raises SourceError when none came for a second."""
        while True:
            try:
                frameset = self._pipeline.wait_for_frames(_TIMEOUT_MS)
            except RuntimeError as error:
                raise SourceError(f"the RealSense is silent: {error}") from error
            frame = self._reader.frame(frameset)
            if frame is not None:
                return frame

    def close(self) -> None:
        """Let the device go."""
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            pipeline.stop()


def lens_of(intrinsics: Any) -> Intrinsics:
    """OpenCV's lens for librealsense's. Its inverse Brown-Conrady model is fitted (within 0.1 px, or SourceError)."""
    rs = _library()
    size = (intrinsics.width, intrinsics.height)
    pinhole = (intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy)
    coefficients = tuple(float(c) for c in intrinsics.coeffs)
    if not any(coefficients):
        return Intrinsics(*size, *pinhole)
    if intrinsics.model in (rs.distortion.brown_conrady, rs.distortion.modified_brown_conrady):
        return Intrinsics(*size, *pinhole, coefficients)
    u, v = np.meshgrid(np.linspace(0, size[0] - 1, 24), np.linspace(0, size[1] - 1, 16))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    rays = np.array([rs.rs2_deproject_pixel_to_point(intrinsics, list(map(float, p)), 1.0)[:2] for p in pixels])
    bent = (pixels - pinhole[2:]) / pinhole[:2] - rays
    x, y = rays[:, 0], rays[:, 1]
    r2 = x * x + y * y
    # Brown-Conrady is linear in k1, k2, p1, p2, k3.
    in_x = np.column_stack([x * r2, x * r2**2, 2 * x * y, r2 + 2 * x * x, x * r2**3])
    in_y = np.column_stack([y * r2, y * r2**2, r2 + 2 * y * y, 2 * x * y, y * r2**3])
    fitted, *_ = np.linalg.lstsq(np.vstack([in_x, in_y]), np.concatenate([bent[:, 0], bent[:, 1]]), rcond=None)
    lens = Intrinsics(*size, *pinhole, tuple(float(c) for c in fitted))
    worst = np.abs(lens.project(np.column_stack([rays, np.ones(len(rays))])) - pixels).max()
    if worst > 0.1:
        raise SourceError(f"this camera's {intrinsics.model} does not fit OpenCV's model (off by {worst:.2f} px)")
    return lens


def _set_exposure(rs: Any, sensor: Any, exposure: float) -> None:
    if sensor.is_depth_sensor() or not sensor.supports(rs.option.exposure):
        return
    if sensor.supports(rs.option.enable_auto_exposure):
        sensor.set_option(rs.option.enable_auto_exposure, 0)
    # The colour camera of the D400 family counts in units of 100 us.
    limits = sensor.get_option_range(rs.option.exposure)
    sensor.set_option(rs.option.exposure, float(np.clip(round(exposure * 1e4), limits.min, limits.max)))


def _gray(colour: Any, rs: Any) -> Gray:
    picture = np.asanyarray(colour.get_data())
    kind = colour.get_profile().format()
    if kind == rs.format.y8:
        return np.array(picture, dtype=np.uint8)
    if kind == rs.format.rgb8:
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), np.uint8)
    if kind == rs.format.bgr8:
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
    raise SourceError(f"colour comes as {kind}, expected rgb8, bgr8 or y8")


def _library() -> Any:
    try:
        import pyrealsense2
    except ImportError as error:
        raise SourceError(
            f"pyrealsense2 is not usable ({error}): pip install 'foottrack[realsense]'; on Linux it needs libusb-1.0"
        ) from error
    return pyrealsense2
