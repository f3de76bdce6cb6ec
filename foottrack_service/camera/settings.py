"""What can be set about the camera beyond where it sits and what the shoes carry."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from foottrack_service.camera.rig import D435_COLOUR, Intrinsics

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Pixels = Annotated[int, Field(gt=0, le=10000)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class LensSettings(_Section):
    """What `calibrate camera` finds, px; OpenCV's distortion coefficients."""

    width: Pixels = D435_COLOUR.width
    height: Pixels = D435_COLOUR.height
    fx: Positive = D435_COLOUR.fx
    fy: Positive = D435_COLOUR.fy
    cx: float = D435_COLOUR.cx
    cy: float = D435_COLOUR.cy
    distortion: tuple[float, ...] = ()

    @model_validator(mode="after")
    def _is_a_lens(self) -> LensSettings:
        self.intrinsics()
        return self

    def intrinsics(self) -> Intrinsics:
        """As the trackers take it."""
        return Intrinsics(
            self.width, self.height, self.fx, self.fy, self.cx, self.cy, tuple(float(c) for c in self.distortion)
        )


class RealSenseSettings(_Section):
    """Intel RealSense with depth."""

    serial: str = Field(default="", description="which one, when there are several")
    width: Pixels = 848
    height: Pixels = 480
    fps: Pixels = 60
    decimation: Annotated[int, Field(ge=1, le=4)] = Field(default=1, description="depth decimation; 1 is none")
    spatial: bool = Field(default=False, description="edge-preserving smoothing of depth")
    temporal: bool = Field(default=False, description="smoothing of depth over time: lags when feet move")
    readout: NotNegative = Field(default=0.010, description="first row's exposure to the last's, s")


class WebcamSettings(_Section):
    """A plain camera: tags only, no depth."""

    device: str = Field(default="0", description="number, path or address, as OpenCV takes it")
    fps: Positive = 30.0
    latency: NotNegative = Field(default=0.030, description="end of the exposure to the picture's arrival, s")
    readout: NotNegative = Field(default=0.016, description="first row's exposure to the last's, s")


class FolderSettings(_Section):
    """A recorded RGB-D sequence in the layout of TUM's benchmark."""

    path: str = ""
    depth_scale: Positive = Field(default=5000.0, description="depth picture's value of one metre")
    loop: bool = False


class RenderedSettings(_Section):
    """The simulation's pictures."""

    task: str = Field(default="steps", description="what the simulated person does")
    seed: int = 0
    fps: Positive = 60.0
    readout: NotNegative = 0.010
    latency: NotNegative = Field(default=0.030, description="exposure to the picture's arrival, s")
    start: int | None = Field(default=None, description="bus time at which the task begins, ns; now, unless given")


class SourceSettings(_Section):
    """Where pictures come from."""

    kind: Literal["none", "realsense", "opencv", "folder", "rendered"] = "none"
    exposure: Annotated[float, Field(gt=0.0, le=0.1)] = Field(
        default=0.003, description="s; above 3 ms, walking feet blur"
    )
    lens: LensSettings = LensSettings()
    realsense: RealSenseSettings = RealSenseSettings()
    opencv: WebcamSettings = WebcamSettings()
    folder: FolderSettings = FolderSettings()
    rendered: RenderedSettings = RenderedSettings()
