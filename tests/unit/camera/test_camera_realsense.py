"""The RealSense path against librealsense's own software device."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from foottrack_service.camera.frame import Frame, SourceError
from foottrack_service.camera.settings import RealSenseSettings
from foottrack_service.camera.sources import realsense

W, H, F = 640, 480, 460.0
NOW = 5_000_000_000_000
UNIX = 1_700_000_000_000_000_000
PERIOD = 16_666_667
STAMPS = [n * PERIOD * 1e-6 for n in range(8)]


def _rs() -> Any:
    try:
        return realsense._library()
    except SourceError as error:
        pytest.skip(str(error))


class Device:
    """Colour and depth sensors of a software device whose depth eye sits 15 mm left of the colour eye."""

    def __init__(self, rs: Any) -> None:
        self.rs = rs
        self.device = rs.software_device()
        self.colour_sensor = self.device.add_sensor("colour")
        self.depth_sensor = self.device.add_sensor("depth")
        lens = rs.intrinsics()
        lens.width, lens.height, lens.ppx, lens.ppy, lens.fx, lens.fy = W, H, W / 2, H / 2, F, F
        lens.model, lens.coeffs = rs.distortion.brown_conrady, [0.0] * 5
        self.colour = self._stream(self.colour_sensor, rs.stream.color, rs.format.rgb8, 3, lens)
        self.depth = self._stream(self.depth_sensor, rs.stream.depth, rs.format.z16, 2, lens)
        apart = rs.extrinsics()
        apart.rotation = [1, 0, 0, 0, 1, 0, 0, 0, 1]
        apart.translation = [-0.015, 0, 0]
        self.depth.register_extrinsics_to(self.colour, apart)
        self.device.create_matcher(rs.matchers.default)
        self.syncer = rs.syncer(10)
        for sensor, profile in ((self.colour_sensor, self.colour), (self.depth_sensor, self.depth)):
            sensor.open(profile)
            sensor.start(self.syncer)
        self.depth_units = 0.001

    def _stream(self, sensor: Any, kind: Any, pixel: Any, size: int, lens: Any) -> Any:
        stream = self.rs.video_stream()
        stream.type, stream.fmt, stream.bpp = kind, pixel, size
        stream.index, stream.uid, stream.width, stream.height, stream.fps = 0, size, W, H, 60
        stream.intrinsics = lens
        return sensor.add_video_stream(stream).as_video_stream_profile()

    def push(self, number: int, stamp_ms: float, gray: Any, depth: Any, domain: Any) -> None:
        """Hand both pictures in."""
        for sensor, profile, pixels, size in (
            (self.depth_sensor, self.depth, np.ascontiguousarray(depth), 2),
            (self.colour_sensor, self.colour, np.repeat(gray[..., None], 3, axis=2), 3),
        ):
            frame = self.rs.software_video_frame()
            frame.pixels, frame.stride, frame.bpp = pixels.ravel().view(np.uint8), W * size, size
            frame.timestamp, frame.domain, frame.frame_number = stamp_ms, domain, number
            frame.profile = profile
            if size == 2:
                frame.depth_units = self.depth_units
            sensor.on_video_frame(frame)

    def close(self) -> None:
        """Stop both sensors."""
        for sensor in (self.colour_sensor, self.depth_sensor):
            sensor.stop()
            sensor.close()


@pytest.fixture
def device() -> Iterator[Device]:
    made = Device(_rs())
    yield made
    made.close()


def deliver(
    device: Device, settings: RealSenseSettings, exposure: float, domain: Any, stamps: list[float], late: list[int]
) -> list[Frame]:
    """Frames of the whole sets that the syncer makes; picture n arrives at NOW + n PERIOD + late[n] ns."""
    arrival = [NOW]
    reader = realsense.FramesetReader(settings, exposure, now=lambda: arrival[0], unix=lambda: UNIX)
    gray = np.tile(np.arange(W, dtype=np.uint8), (H, 1))
    depth = np.full((H, W), 1500, dtype=np.uint16)
    frames = []
    for number, stamp in enumerate(stamps):
        device.push(number, stamp, gray, depth, domain)
        while True:
            frameset = device.syncer.wait_for_frames(2000)
            if frameset.get_depth_frame() and frameset.get_color_frame():
                taken = frameset.get_color_frame().get_frame_number()
                arrival[0] = NOW + taken * PERIOD + late[taken]
                frame = reader.frame(frameset)
                assert frame is not None
                frames.append(frame)
            if number == 0 or frames:
                break
    return frames


def test_depth_comes_aligned_to_colour_with_its_unit(device: Device) -> None:
    domain = device.rs.timestamp_domain.hardware_clock
    frame = deliver(device, RealSenseSettings(), 0.003, domain, STAMPS[:4], [0] * 4)[-1]
    assert frame.gray.shape == (H, W) and frame.depth is not None
    assert frame.depth_unit == pytest.approx(0.001)
    np.testing.assert_allclose(frame.gray[7, 20:230], np.arange(20, 230), atol=1)
    # Depth pixel u shows up in colour at u - 460 * 0.015 / 1.5 = u - 4.6, so the right rim stays unknown.
    assert np.all(frame.depth[100, 10 : W - 10] == 1500)
    assert np.all(frame.depth[100, -4:] == 0)


def test_global_time_becomes_bus_time_of_mid_exposure(device: Device) -> None:
    stamps = [UNIX * 1e-6 - 30 + stamp for stamp in STAMPS[:5]]
    late = [1_000_000 * n for n in (3, 1, 4, 1, 5)]
    domain = device.rs.timestamp_domain.global_time
    frames = deliver(device, RealSenseSettings(readout=0.010), 0.004, domain, stamps, late)
    assert len(frames) >= 2
    for frame in frames:
        # `unix` stands still here while the bus clock moves on: the stamp is placed against both at arrival.
        at_arrival = NOW + frame.number * PERIOD + late[frame.number]
        expected = at_arrival + frame.number * PERIOD - 37_000_000
        assert frame.t == pytest.approx(expected, abs=300)  # a double holds milliseconds of 2023 to 240 ns


def test_hardware_clock_follows_the_shortest_way(device: Device) -> None:
    late = [1_000_000 * n for n in (9, 2, 12, 5, 3, 8, 6, 4)]
    domain = device.rs.timestamp_domain.hardware_clock
    frames = deliver(device, RealSenseSettings(readout=0.0), 0.0001, domain, STAMPS, late)
    assert len(frames) >= 4
    least = late[frames[0].number]
    for frame in frames:
        # The drift that is allowed for may add a third of a microsecond a picture.
        least = min(least + 333, late[frame.number])
        assert frame.t - (NOW + frame.number * PERIOD) == pytest.approx(least - 50_000, abs=5)
    assert least < 3_100_000


def test_hardware_clock_that_begins_again_after_71_minutes_is_followed(device: Device) -> None:
    wraps = 2**32 * 1e-3
    stamps = [(wraps + stamp - STAMPS[4]) % wraps for stamp in STAMPS]
    assert stamps[4] < stamps[3]
    domain = device.rs.timestamp_domain.hardware_clock
    frames = deliver(device, RealSenseSettings(readout=0.0), 0.0001, domain, stamps, [2_000_000] * len(stamps))
    assert {frame.number < 4 for frame in frames} == {True, False}
    for frame in frames:
        assert frame.t - (NOW + frame.number * PERIOD) == pytest.approx(1_950_000, abs=3_000)


def test_inverse_brown_conrady_is_fitted() -> None:
    rs = _rs()
    lens = rs.intrinsics()
    lens.width, lens.height, lens.ppx, lens.ppy, lens.fx, lens.fy = W, H, 321.0, 238.0, F, F + 1
    lens.model, lens.coeffs = rs.distortion.inverse_brown_conrady, [-0.055, 0.065, 0.0005, -0.0003, -0.02]
    ours = realsense.lens_of(lens)
    for pixel in ([10.0, 12.0], [320.0, 240.0], [600.0, 450.0]):
        point = rs.rs2_deproject_pixel_to_point(lens, pixel, 2.0)
        np.testing.assert_allclose(ours.project([point])[0], pixel, atol=0.1)


def test_no_camera_is_said_clearly() -> None:
    _rs()
    with pytest.raises(SourceError, match="no RealSense none-such is plugged in"):
        realsense.RealSenseSource(RealSenseSettings(serial="none-such"), 0.003)
