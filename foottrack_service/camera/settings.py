"""What can be set about the camera beyond where it sits and what the shoes carry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, field_validator

from foottrack_service.section import Section

if TYPE_CHECKING:
    from foottrack_service.camera.rig import Intrinsics

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pixels = Annotated[int, Field(gt=0, le=10000)]


DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
"""How many coefficients OpenCV's models have."""


class LensSettings(Section):
    """What `calibrate camera` finds, px; OpenCV's distortion coefficients."""

    width: Pixels = 848
    height: Pixels = 480
    fx: Positive = 612.0
    fy: Positive = 612.0
    cx: Finite = 423.5
    cy: Finite = 239.5
    distortion: tuple[Finite, ...] = ()

    @field_validator("distortion")
    @classmethod
    def _is_a_model(cls, distortion: tuple[float, ...]) -> tuple[float, ...]:
        if len(distortion) not in DISTORTION_LENGTHS:
            raise ValueError(f"0, 4, 5, 8, 12 or 14 coefficients, not {len(distortion)}")
        return distortion

    def intrinsics(self) -> Intrinsics:
        """As the trackers take it."""
        # Settings are read by every command; OpenCV is loaded by those that look at pictures.
        from foottrack_service.camera.rig import Intrinsics

        return Intrinsics(self.width, self.height, self.fx, self.fy, self.cx, self.cy, self.distortion)


class RealSenseSettings(Section):
    """Intel RealSense with depth."""

    serial: str = Field(default="", description="which one, when there are several")
    width: Pixels = 848
    height: Pixels = 480
    fps: Pixels = 60
    decimation: Annotated[int, Field(ge=1, le=4)] = Field(default=1, description="depth decimation; 1 is none")
    spatial: bool = Field(default=False, description="edge-preserving smoothing of depth")
    temporal: bool = Field(default=False, description="smoothing of depth over time: lags when feet move")
    readout: NotNegative = Field(default=0.010, description="first row's exposure to the last's, s")


class WebcamSettings(Section):
    """A plain camera: tags only, no depth."""

    device: str = Field(default="0", description="number, path or address, as OpenCV takes it")
    fps: Positive = 30.0
    latency: NotNegative = Field(default=0.030, description="end of the exposure to the picture's arrival, s")
    readout: NotNegative = Field(default=0.016, description="first row's exposure to the last's, s")


class FolderSettings(Section):
    """A recorded RGB-D sequence in the layout of TUM's benchmark."""

    path: str = ""
    depth_scale: Positive = Field(default=5000.0, description="depth picture's value of one metre")
    loop: bool = False


class RenderedSettings(Section):
    """The simulation's pictures."""

    task: str = Field(default="steps", description="what the simulated person does")
    seed: int = 0
    seconds: Positive | None = Field(default=None, description="how long; the task's own length unless given")
    feet: Literal["mild", "hard"] = "mild"
    covered: tuple[tuple[NotNegative, NotNegative], ...] = Field(
        default=(), description="when trouser legs hang over the tags, [begin, end) s of the task"
    )
    fps: Positive = 60.0
    readout: NotNegative = 0.010
    latency: NotNegative = Field(default=0.030, description="exposure to the picture's arrival, s")
    start: int | None = Field(default=None, description="bus time at which the task begins, ns; now, unless given")


class SourceSettings(Section):
    """Where pictures come from."""

    kind: Literal["none", "realsense", "opencv", "folder", "rendered"] = "none"
    preview: bool = Field(default=False, description="publish camera/preview, at most 5 pictures a second")
    exposure: Annotated[float, Field(gt=0.0, le=0.1)] = Field(
        default=0.003, description="s; above 3 ms, walking feet blur"
    )
    lens: LensSettings = LensSettings()
    realsense: RealSenseSettings = RealSenseSettings()
    opencv: WebcamSettings = WebcamSettings()
    folder: FolderSettings = FolderSettings()
    rendered: RenderedSettings = RenderedSettings()
