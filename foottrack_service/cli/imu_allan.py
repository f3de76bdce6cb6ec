"""``foottrack imu allan``: the noises of an IMU that lay still, beside its data sheet's."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from foottrack_service.imu.allan import AllanCurve, AllanNoise, TooShort, allan_curve, fit_noise
from foottrack_service.imu.datasheets import NoiseDensity
from foottrack_service.imu.still import NotStill, still_recording
from foottrack_service.recording.reader import read

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXES = "xyz"
UNITS = {"gyro": "rad/s", "acc": "m/s²"}
NOISE_UNITS = {
    "quantisation": "{u}·s",
    "random_walk": "{u}/√Hz",
    "bias_instability": "{u}",
    "rate_random_walk": "{u}/√s",
    "ramp": "{u}/s",
}

Curves = dict[str, dict[str, list[tuple[AllanCurve, AllanNoise]]]]
"""By topic, then "gyro" and "acc": a curve and its noises for each axis."""


def analyse(file: Path) -> tuple[Curves, dict[str, str]]:
    """Curves of each IMU in a recording, and by topic why there are none. Raises RecordingError."""
    samples: dict[str, list[tuple[int, Any]]] = {}
    for recorded in read(file):
        message = recorded.message
        if message.stream.startswith("imu/") and message.valid:
            samples.setdefault(message.topic, []).append((message.t, message.data))
    curves: Curves = {}
    refused: dict[str, str] = {}
    for topic, found in sorted(samples.items()):
        t = np.array([at for at, _ in found]) * 1e-9
        has_gyro = all(imu.gyro is not None for _, imu in found)
        gyro = np.array([imu.gyro for _, imu in found]) if has_gyro else None
        try:
            still = still_recording(t - t[0], np.array([imu.acc for _, imu in found]), gyro)
            signals = {"acc": still.acc} if still.gyro is None else {"gyro": still.gyro, "acc": still.acc}
            curves[topic] = {
                name: [
                    (curve, fit_noise(curve))
                    for curve in (allan_curve(signal[:, axis], still.period_s) for axis in range(3))
                ]
                for name, signal in signals.items()
            }
        except (NotStill, TooShort) as error:
            refused[topic] = str(error)
    return curves, refused


def as_values(curves: Curves, sheet: NoiseDensity | None) -> dict[str, Any]:
    """What ``--json`` prints: the five coefficients by topic, signal and axis, SI units."""
    values: dict[str, Any] = {
        topic: {
            name: {axis: asdict(noise) for axis, (_, noise) in zip(AXES, axes, strict=True)}
            for name, axes in signals.items()
        }
        for topic, signals in curves.items()
    }
    return {"imus": values, "data_sheet": None if sheet is None else sheet._asdict()}


def as_lines(curves: Curves, sheet: NoiseDensity | None) -> list[str]:
    """The same as text."""
    lines = []
    for topic, signals in curves.items():
        for name, axes in signals.items():
            lines.append(f"{topic}  {name}")
            for noise, unit in NOISE_UNITS.items():
                numbers = "  ".join(
                    f"{axis} {getattr(found, noise):9.3g}" for axis, (_, found) in zip(AXES, axes, strict=True)
                )
                beside = f"  data sheet {getattr(sheet, name):.3g}" if sheet and noise == "random_walk" else ""
                lines.append(f"  {noise.replace('_', ' '):18}{numbers}  {unit.format(u=UNITS[name])}{beside}")
    return lines


def draw(curves: Curves, sheet: NoiseDensity | None, out: Path) -> None:
    """The curves, their fits and the data sheet's line as a PNG. Raises OSError."""
    from matplotlib.figure import Figure

    panels = [(topic, name, axes) for topic, signals in curves.items() for name, axes in signals.items()]
    figure = Figure(figsize=(6.4 * max(1, min(2, len(panels))), 4.8 * ((len(panels) + 1) // 2)), layout="constrained")
    grid = figure.subplots((len(panels) + 1) // 2, min(2, len(panels)), squeeze=False)
    for panel in grid.flat[len(panels) :]:
        panel.set_axis_off()
    for panel, (topic, name, axes) in zip(grid.flat, panels, strict=False):
        _panel(panel, f"{topic}, {name}", UNITS[name], axes, None if sheet is None else getattr(sheet, name))
    figure.savefig(out, format="png", dpi=120)


def _panel(
    panel: Axes, title: str, unit: str, axes: list[tuple[AllanCurve, AllanNoise]], density: float | None
) -> None:
    for axis, colour, (curve, noise) in zip(AXES, ("C3", "C2", "C0"), axes, strict=True):
        panel.loglog(curve.tau, curve.deviation, ".", color=colour, label=axis)
        panel.loglog(curve.tau, noise.deviation(curve.tau), "-", color=colour, linewidth=1)
    if density is not None:
        tau = axes[0][0].tau
        panel.loglog(tau, density / np.sqrt(tau), "k--", linewidth=1, label="data sheet")
    panel.set(title=title, xlabel="averaging time, s", ylabel=f"Allan deviation, {unit}")
    panel.grid(which="both", alpha=0.3)
    panel.legend()
