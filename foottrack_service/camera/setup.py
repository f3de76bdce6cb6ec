"""From settings to sources and trackers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from foottrack_protocol.frames import SIDES
from foottrack_service.camera.depth_tracker import DepthTracker
from foottrack_service.camera.detector import Window
from foottrack_service.camera.dictionaries import load_dictionary
from foottrack_service.camera.fix import Fix
from foottrack_service.camera.frame import Frame, Source, SourceError
from foottrack_service.camera.marker_tracker import MarkerTracker
from foottrack_service.camera.rig import Intrinsics, Rig
from foottrack_service.camera.sources.folder import FolderSource
from foottrack_service.camera.sources.realsense import RealSenseSource
from foottrack_service.camera.sources.webcam import WebcamSource
from foottrack_service.camera.targets import Tag, Target
from foottrack_service.config import CameraSettings, Settings


class Trackers:
    """Marker and depth tracker of one camera."""

    def __init__(self, settings: CameraSettings, intrinsics: Intrinsics) -> None:
        """Raises ValueError: a dictionary, a tag or a mount that cannot be."""
        self.rig = rig_of(settings, intrinsics)
        dictionary, targets = load_dictionary(settings.dictionary), targets_of(settings)
        for target in targets:
            for tag in target.tags:
                if tag.id >= len(dictionary.bytesList):
                    raise ValueError(f"the dictionary has {len(dictionary.bytesList)} tags, none with id {tag.id}")
        self._markers = MarkerTracker(self.rig, dictionary, targets)
        self._depth = DepthTracker(self.rig)

    @property
    def windows(self) -> dict[str, Window]:
        """Where the last picture was looked at."""
        return self._markers.windows

    def process(self, frame: Frame) -> list[Fix]:
        """All fixes of a picture: at most one of each kind and side."""
        markers = self._markers.process(frame)
        return markers + self._depth.process(frame, markers)


def rig_of(settings: CameraSettings, intrinsics: Intrinsics) -> Rig:
    """The camera as it is mounted."""
    return Rig(intrinsics, settings.mount.p, settings.mount.q)


def targets_of(settings: CameraSettings) -> list[Target]:
    """What the shoes carry. Raises ValueError."""
    return [
        Target(side, tuple(Tag(tag.id, tag.size, tag.p, tag.q) for tag in settings.targets.of(side).tags))
        for side in SIDES
    ]


def open_source(settings: Settings, now: Callable[[], int] | None) -> Source:
    """The configured source; with `now` (bus clock, ns) recorded and rendered ones keep real time.

    Raises SourceError, with what to do about it.
    """
    source = settings.camera.source
    if source.kind == "realsense":
        return RealSenseSource(source.realsense, source.exposure)
    if source.kind == "rendered":
        return _open_rendered(settings, now)
    lens = source.lens.intrinsics()
    if source.kind == "folder":
        if not source.folder.path:
            raise SourceError("[camera.source.folder] path is not set")
        folder = source.folder
        return FolderSource(Path(folder.path), lens, source.exposure, folder.depth_scale, now, folder.loop)
    if source.kind == "opencv":
        webcam = source.opencv
        return WebcamSource(webcam.device, lens, source.exposure, webcam.fps, webcam.latency, webcam.readout)
    raise SourceError("no camera is configured: set [camera.source] kind to realsense, opencv, folder or rendered")


def _open_rendered(settings: Settings, now: Callable[[], int] | None) -> Source:
    # The simulation is needed by this source alone.
    from foottrack_service.camera.rendering.renderer import Renderer, Shutter
    from foottrack_service.camera.rendering.scene import Scene, make_shoe
    from foottrack_service.camera.sources.rendered import RenderedSource
    from foottrack_service.simulation.scenario import simulate

    camera, source = settings.camera, settings.camera.source
    rendered = source.rendered
    try:
        scenario = simulate(
            rendered.task,
            rendered.seed,
            settings=settings,
            seconds=rendered.seconds,
            feet=rendered.feet,
            camera=False,
            left_imu=False,
            right_imu=False,
        )
        dictionary = load_dictionary(camera.dictionary)
        shoes = {}
        for target in targets_of(camera):
            foot = settings.feet.left if target.side == "left" else settings.feet.right
            shoes[target.side] = make_shoe(target, dictionary, foot.marker.p, foot.marker.q, foot.ankle_height)
    except ValueError as error:
        raise SourceError(f"[camera.source.rendered]: {error}") from error
    truth = scenario.truth
    scene = Scene(truth.head.pose, {side: truth.feet[side].pose for side in SIDES}, shoes, covered=rendered.covered)
    renderer = Renderer(
        scene,
        rig_of(camera, source.lens.intrinsics()),
        Shutter(source.exposure, rendered.readout),
        seed=rendered.seed,
    )
    start = rendered.start if rendered.start is not None else 0 if now is None else now()
    return RenderedSource(renderer, rendered.fps, start, rendered.latency, now, scenario.seconds)
