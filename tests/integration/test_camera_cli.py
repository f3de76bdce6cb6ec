"""The camera's commands, as a person types them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from foottrack_protocol.messages import HeadPose
from foottrack_service.bus import Broker, Bus
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.rendering.renderer import Renderer
from foottrack_service.camera.sources.rendered import RenderedSource
from foottrack_service.cli.camera_floor import measure_floor
from foottrack_service.cli.main import app
from foottrack_service.cli.running import EXIT_USAGE, CommandFailed
from foottrack_service.config import CameraSettings, Settings

RENDERED = '[camera.source]\nkind = "rendered"\n[camera.source.rendered]\ntask = "still"\nlatency = 0.0\nfps = 30.0\n'


def call(*words: str) -> str:
    """A command's output. Raises what it raises."""
    result = CliRunner().invoke(app, list(words), catch_exceptions=False, standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return result.stdout


@pytest.fixture
def rendered(tmp_path: Path) -> str:
    """A settings file with the simulation as camera."""
    path = tmp_path / "foottrack.toml"
    path.write_text(RENDERED)
    return str(path)


def test_show_writes_one_picture_or_many(rendered: str, tmp_path: Path) -> None:
    file = tmp_path / "feet.png"
    said = json.loads(call("camera", "--show", str(file), "--count", "3", "--config", rendered, "--json"))
    assert said["pictures"] == 3 and said["found"]["marker/left"] >= 1 and said["files"] == [str(file)]
    picture = cv2.imread(str(file))
    assert picture is not None and picture.shape == (480, 848, 3)
    # What is drawn has colour, what the camera sees has none.
    assert np.any(np.ptp(picture.astype(int), axis=2) > 100)
    folder = tmp_path / "all"
    said = json.loads(call("camera", "--show", str(folder), "--count", "2", "--config", rendered, "--json"))
    assert sorted(map(str, folder.iterdir())) == sorted(said["files"]) and len(said["files"]) == 2


def test_show_fails_when_no_foot_is_seen(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((480, 848), 90, np.uint8))
    (tmp_path / "rgb.txt").write_text("1.0 a.png")
    config = tmp_path / "c.toml"
    config.write_text(f'[camera.source]\nkind = "folder"\n[camera.source.folder]\npath = {json.dumps(str(tmp_path))}\n')
    with pytest.raises(CommandFailed, match="no foot was found"):
        call("camera", "--show", str(tmp_path / "x.png"), "--config", str(config))
    with pytest.raises(CommandFailed, match="no camera is configured"):
        config.write_text("")
        call("camera", "--show", str(tmp_path / "x.png"), "--config", str(config))


def test_markers_prints_the_settings_tags(tmp_path: Path) -> None:
    config, out = tmp_path / "c.toml", tmp_path / "m.pdf"
    config.write_text('[camera]\ndictionary = "GENERATED_3X3_4"\n')
    said = json.loads(call("markers", "--out", str(out), "--config", str(config), "--json"))
    assert said["tags"] == [[0, 60.0], [1, 60.0]] and out.read_bytes().startswith(b"%PDF")
    said = json.loads(
        call("markers", "--out", str(out), "--config", str(config), "--json", "--id", "3", "--size", "80")
    )
    assert said["tags"] == [[3, 80.0]]
    with pytest.raises(CommandFailed, match="ids 0 to 3") as refused:
        call("markers", "--out", str(out), "--config", str(config), "--id", "4", "--size", "80")
    assert refused.value.code == EXIT_USAGE


def board_pictures(folder: Path, count: int) -> list[str]:
    """Pictures of a 9x6 chessboard through a pinhole of f = 500 px, 640x480."""
    cell = 20
    flat = np.kron(np.indices((7, 10)).sum(axis=0) % 2 * 210 + 20, np.ones((cell, cell))).astype(np.uint8)
    flat = cv2.copyMakeBorder(flat, cell, cell, cell, cell, cv2.BORDER_CONSTANT, value=240)
    K = np.array([[500.0, 0.0, 319.5], [0.0, 500.0, 239.5], [0.0, 0.0, 1.0]])
    metre = 0.025 / cell
    to_plane = np.array([[metre, 0, -0.15 + metre / 2], [0, metre, -0.1125 + metre / 2], [0, 0, 1.0]])
    source, files = np.random.default_rng(4), []
    while len(files) < count:
        R = cv2.Rodrigues(source.uniform(-0.5, 0.5, 3))[0]
        place = np.array([*source.uniform((-0.2, -0.14), (0.2, 0.14)), source.uniform(0.45, 0.6)])
        homography = K @ np.column_stack([R[:, :2], place]) @ to_plane
        corners = cv2.perspectiveTransform(
            np.array([[[0.0, 0.0], [240, 0], [240, 180], [0, 180]]]), homography
        ).reshape(-1, 2)
        if corners.min() < 0 or corners[:, 0].max() > 640 or corners[:, 1].max() > 480:
            continue
        # Supersampled, as a lens would average.
        fine = np.diag([3.0, 3.0, 1.0]) @ np.array([[1, 0, 1 / 3], [0, 1, 1 / 3], [0, 0, 1]]) @ homography
        big = cv2.warpPerspective(flat, fine, (1920, 1440), borderValue=120)
        file = folder / f"board{len(files):02d}.png"
        cv2.imwrite(str(file), cv2.resize(big, (640, 480), interpolation=cv2.INTER_AREA))
        files.append(str(file))
    return files


def test_calibrate_camera_from_files(tmp_path: Path) -> None:
    files = board_pictures(tmp_path, 14)
    said = json.loads(call("calibrate", "camera", *files, "--json"))
    assert said["lens"]["fx"] == pytest.approx(500.0, abs=2.0) and said["lens"]["cx"] == pytest.approx(319.5, abs=2.0)
    assert said["rms_px"] < 0.2 and said["views"] == 14
    # What is printed can be put into the settings as it is.
    config = tmp_path / "c.toml"
    config.write_text(call("calibrate", "camera", *files))
    from foottrack_service.config import load

    assert load(config).settings.camera.source.lens.fx == pytest.approx(said["lens"]["fx"])
    with pytest.raises(CommandFailed, match="refused: 4 views show the board"):
        call("calibrate", "camera", *files[:4])
    with pytest.raises(CommandFailed, match="is no picture"):
        call("calibrate", "camera", str(config))


class Accompanied:
    """A rendered source that publishes the head's pose around each picture, as a headset would."""

    def __init__(self, bus: Bus, source: RenderedSource, renderer: Renderer) -> None:
        self._source, self._renderer = source, renderer
        self._publisher = bus.publisher("headset")
        self._publisher.wait_ready()
        self.intrinsics = source.intrinsics

    def read(self) -> Frame:
        """The picture, with poses 10 ms before and after it."""
        frame = self._source.read()
        for t in (frame.t - 10_000_000, frame.t + 10_000_000):
            p, q = self._renderer.scene.head(np.array([t * 1e-9]))
            body = HeadPose(p=tuple(p[0].tolist()), q=tuple(q[0].tolist()), tracked=True)
            self._publisher.publish("user", "head/pose", t, body)
        return frame

    def close(self) -> None:
        """The bus closes the publisher."""


def test_calibrate_floor_publishes_what_it_found(broker: Broker, bus: Bus, run: Callable[[Any], Any]) -> None:
    from foottrack_service.camera.setup import open_source

    source_settings = {"kind": "rendered", "rendered": {"task": "head-moving", "seconds": 5.0, "fps": 20.0, "start": 0}}
    given = Settings(camera=CameraSettings.model_validate({"source": source_settings}), bus=broker.endpoints)
    listener = bus.subscriber(["user/calibration"])
    listener.wait_ready()
    source = open_source(given, None)
    assert isinstance(source, RenderedSource)
    found = measure_floor(given, Accompanied(bus, source, source._renderer), 15)
    assert abs(found.height) < 0.01 and found.pictures >= 15

    async def published() -> Any:
        return (await anext(aiter(listener))).message.data

    assert run(published()).values.height == pytest.approx(found.height)
