"""Folder, webcam (on a file), rendered: what they deliver, and how they fail."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from camera_scenes import RIG, looking_down, stepping, world

from foottrack_service.camera.frame import Frame, SourceEnded, SourceError
from foottrack_service.camera.marker_tracker import MarkerTracker
from foottrack_service.camera.rig import Intrinsics
from foottrack_service.camera.setup import open_source
from foottrack_service.camera.sources.folder import FolderSource
from foottrack_service.camera.sources.rendered import RenderedSource
from foottrack_service.camera.sources.webcam import WebcamSource
from foottrack_service.config import CameraSettings, Settings

LENS = Intrinsics(848, 480, 612.0, 612.0, 423.5, 239.5)
SMALL = Intrinsics(64, 48, 50.0, 50.0, 31.5, 23.5)


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    """Three rendered pictures in TUM's layout, the second without depth."""
    made = world(looking_down(), {"left": stepping(-0.1, 0.0)})
    colour, depth = ["# timestamp filename"], ["# timestamp filename", ""]
    for number in range(3):
        frame = made.frame(number)
        cv2.imwrite(str(tmp_path / f"c{number}.png"), frame.gray)
        assert frame.depth is not None
        cv2.imwrite(str(tmp_path / f"d{number}.png"), frame.depth * 5)
        stamp = 1305031102.175304 + number / 60
        colour.append(f"{stamp:.6f} c{number}.png")
        if number != 1:
            depth.append(f"{stamp + 0.004:.6f} d{number}.png")
    (tmp_path / "rgb.txt").write_text("\n".join(colour))
    (tmp_path / "depth.txt").write_text("\n".join(depth))
    return tmp_path


def read_all(source: Any) -> list[Frame]:
    """Until it ends."""
    frames = []
    with pytest.raises(SourceEnded):
        while True:
            frames.append(source.read())
    source.close()
    source.close()
    return frames


def test_a_folder_gives_pictures_depth_and_stamps(sequence: Path) -> None:
    frames = read_all(FolderSource(sequence, LENS, 0.003))
    assert [frame.number for frame in frames] == [0, 1, 2]
    assert frames[0].t == pytest.approx(1305031102_175304000, abs=500)
    assert frames[1].t - frames[0].t == pytest.approx(1e9 / 60, abs=2000)
    # The second has none of its own, and the others' are less than 20 ms away: the nearest is taken.
    assert all(frame.depth is not None and frame.depth_unit == pytest.approx(1 / 5000) for frame in frames)
    made = world(looking_down(), {"left": stepping(-0.1, 0.0)})
    fixes = MarkerTracker(RIG, made.dictionary, made.targets).process(frames[0])
    assert len(fixes) == 1 and fixes[0].size_ratio == pytest.approx(1.0, abs=0.08)


def test_who_comes_late_has_missed_pictures(sequence: Path) -> None:
    clock = [10**9]
    source = FolderSource(sequence, LENS, 0.003, now=lambda: clock[0], loop=True)
    assert source.read().number == 0
    clock[0] += round(5.5e9 / 60)
    assert source.read().number == 5
    clock[0] = 10**9 + round(6.2e9 / 60)
    assert source.read().number == 6


def test_arrays_are_mapped_instead_of_decoded(sequence: Path) -> None:
    decoded = read_all(FolderSource(sequence, LENS, 0.003))
    for list_name in ("rgb.txt", "depth.txt"):
        (sequence / list_name).write_text((sequence / list_name).read_text().replace(".png", ".npy"))
    for path in sequence.glob("*.png"):
        np.save(path.with_suffix(".npy"), cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    mapped = read_all(FolderSource(sequence, LENS, 0.003))
    for one, other in zip(decoded, mapped, strict=True):
        np.testing.assert_array_equal(one.gray, other.gray)
        np.testing.assert_array_equal(np.asarray(one.depth), np.asarray(other.depth))
    for wrong in (b"no array", (sequence / "d0.npy").read_bytes()):
        (sequence / "c0.npy").write_bytes(wrong)
        with pytest.raises(SourceError, match="is no picture"):
            FolderSource(sequence, LENS, 0.003).read()


def test_a_folder_can_play_from_now_on_in_its_own_time(sequence: Path) -> None:
    start = 5_000_000_000
    source = FolderSource(sequence, LENS, 0.003, now=lambda: start + 10**9, loop=True)
    frames = [source.read() for _ in range(7)]
    assert frames[0].t == start + 10**9
    steps = np.diff([frame.t for frame in frames])
    np.testing.assert_allclose(steps, 1e9 / 60, atol=5000)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda path: (path / "rgb.txt").unlink(), "TUM's layout"),
        (lambda path: (path / "rgb.txt").write_text("# nothing\n"), "lists no pictures"),
        (lambda path: (path / "rgb.txt").write_text("soon c0.png"), "line 1: 'soon' is no time stamp"),
        (lambda path: (path / "rgb.txt").write_text("1.0"), "line 1"),
        (lambda path: (path / "rgb.txt").write_text("nan c0.png"), "line 1"),
        (lambda path: (path / "c0.png").write_bytes(b"x"), "c0.png is no picture"),
        (lambda path: (path / "d0.png").write_bytes(b"x"), "no 16 bit depth"),
        (lambda path: cv2.imwrite(str(path / "c0.png"), np.zeros((10, 10), np.uint8)), "10x10"),
    ],
)
def test_a_broken_folder_is_said_clearly(sequence: Path, change: Any, text: str) -> None:
    change(sequence)
    with pytest.raises(SourceError, match=text):
        FolderSource(sequence, LENS, 0.003).read()


@pytest.fixture
def video(tmp_path: Path) -> str:
    """Five pictures, ever brighter."""
    path = str(tmp_path / "video.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    for grey in range(5):
        writer.write(np.full((48, 64, 3), 40 * grey, np.uint8))
    writer.release()
    return path


def test_a_webcam_is_grey_and_stamped_back_to_mid_exposure(video: str) -> None:
    arrivals = iter(range(10**12, 10**13, 33_000_000))
    source = WebcamSource(video, SMALL, 0.004, 30.0, 0.030, 0.016, now=lambda: next(arrivals))
    frames = read_all(source)
    assert [round(float(frame.gray.mean()) / 40) for frame in frames] == [0, 1, 2, 3, 4]
    assert frames[2].t == 10**12 + 2 * 33_000_000 - 40_000_000 and frames[2].depth is None
    # Rows above the middle are exposed earlier.
    assert frames[2].row_time(0.0) == frames[2].t - 8_000_000
    assert frames[2].row_time(47.0) == frames[2].t + 8_000_000


def test_a_webcam_that_is_not_there_or_of_another_size_is_said(video: str, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="plugged in"):
        WebcamSource(str(tmp_path / "none.avi"), SMALL, 0.003, 30.0, 0.0, 0.0)
    with pytest.raises(SourceError, match="64x48 px, the lens is for 848x480"):
        WebcamSource(video, LENS, 0.003, 30.0, 0.0, 0.0)


def test_a_slow_renderer_drops_pictures_and_shows_it() -> None:
    made = world(looking_down(), {"left": stepping(-0.1, 0.0)}, depth=None)
    clock = iter([1000, 1000 + 10**9, 1000 + 10**9] + [1000 + 11 * 10**8] * 4)
    source = RenderedSource(made.renderer, 10.0, 1000, now=lambda: next(clock), duration=1.05)
    assert source.read().number == 0
    late = source.read()
    assert late.number == 10 and late.t == 1000 + 10**9
    with pytest.raises(SourceEnded):
        source.read()


def test_the_simulations_task_is_rendered_through_the_settings() -> None:
    camera = {"source": {"kind": "rendered", "rendered": {"task": "steps", "seconds": 2.0, "fps": 20.0, "start": 77}}}
    source = open_source(Settings(camera=CameraSettings.model_validate(camera)), None)
    frames = [source.read() for _ in range(3)]
    assert [frame.t for frame in frames] == [77, 77 + 50_000_000, 77 + 100_000_000]
    assert frames[0].gray.shape == (480, 848) and frames[0].depth is not None
    again = open_source(Settings(camera=CameraSettings.model_validate(camera)), None).read()
    np.testing.assert_array_equal(frames[0].gray, again.gray)
    np.testing.assert_array_equal(frames[0].depth, again.depth)
