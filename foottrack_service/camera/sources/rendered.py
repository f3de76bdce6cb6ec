"""The simulated camera: pictures of a scene, taken at a steady rate."""

from __future__ import annotations

import time
from collections.abc import Callable

from foottrack_service.camera.frame import Frame, SourceEnded
from foottrack_service.camera.rendering.renderer import Renderer
from foottrack_service.camera.rig import Intrinsics


class RenderedSource:
    """Picture n is taken at `start` + n / `fps`; scene time 0 is `start` (bus clock, ns).

    With `now` it is a live camera: a picture arrives `latency` s after it was taken at the earliest, and when drawing
    is slower than `fps` pictures are missing, as their numbers show. Without, every picture is drawn at once.
    """

    def __init__(
        self,
        renderer: Renderer,
        fps: float,
        start: int,
        latency: float = 0.0,
        now: Callable[[], int] | None = None,
        duration: float | None = None,
    ) -> None:
        self._renderer, self._fps, self._start = renderer, fps, start
        self._latency, self._now, self._duration = latency, now, duration
        self._next = 0

    @property
    def intrinsics(self) -> Intrinsics:
        """The true ones."""
        return self._renderer.rig.intrinsics

    def read(self) -> Frame:
        """The next picture. Raises SourceEnded after `duration` s."""
        if self._now is not None:
            due = int((self._now() - self._start) * 1e-9 * self._fps)
            self._next = max(self._next, due)
        number, self._next = self._next, self._next + 1
        taken = number / self._fps
        if self._duration is not None and taken > self._duration:
            raise SourceEnded(f"the scene lasts {self._duration:g} s")
        gray, depth = self._renderer.render(taken)
        t = self._start + round(taken * 1e9)
        if self._now is not None:
            time.sleep(max(0.0, (t - self._now()) * 1e-9 + self._latency))
        shutter = self._renderer.shutter
        return Frame(gray, depth, t, number, shutter.exposure, shutter.readout)

    def close(self) -> None:
        """Nothing is held."""
