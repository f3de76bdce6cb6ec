"""Any camera that OpenCV can open: grey pictures without depth, stamped on arrival."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import cv2
import numpy as np

from foottrack_service.camera.frame import Frame, SourceEnded, SourceError
from foottrack_service.camera.rig import Intrinsics


class WebcamSource:
    """A plain camera, or a video file, which then ends.

    `t` is the arrival less `latency` s less half the exposure less half the readout: a webcam tells nothing better.
    """

    def __init__(
        self,
        device: str,
        intrinsics: Intrinsics,
        exposure: float,
        fps: float,
        latency: float,
        readout: float,
        now: Callable[[], int] = time.perf_counter_ns,
    ) -> None:
        """Raises SourceError when it does not open, or delivers another size than the lens was calibrated for."""
        self.intrinsics = intrinsics
        self._now, self._exposure, self._readout = now, exposure, readout
        self._delay = round((latency + 0.5 * exposure + 0.5 * readout) * 1e9)
        self._is_live = device.isdigit()
        self._device = device
        self._number = -1
        self._capture = cv2.VideoCapture(int(device)) if self._is_live else cv2.VideoCapture(device)
        if not self._capture.isOpened():
            raise SourceError(
                f"OpenCV cannot open camera {device!r}: is it plugged in, and not used by another program?"
            )
        if self._is_live:
            self._configure(fps)
        size = (int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
        if size != (intrinsics.width, intrinsics.height):
            self.close()
            raise SourceError(
                f"camera {device!r} delivers {size[0]}x{size[1]} px, "
                f"the lens is for {intrinsics.width}x{intrinsics.height}"
            )

    def read(self) -> Frame:
        """The next picture. Raises SourceError when a camera stops, SourceEnded at the end of a file."""
        sound, picture = self._capture.read()
        t = self._now() - self._delay
        if not sound:
            if self._is_live:
                raise SourceError(f"camera {self._device!r} stopped: unplugged?")
            raise SourceEnded(f"{self._device} has {self._number + 1} pictures")
        self._number += 1
        gray = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        return Frame(np.asarray(gray, np.uint8), None, t, self._number, self._exposure, self._readout)

    def close(self) -> None:
        """Let the device go."""
        self._capture.release()

    def _configure(self, fps: float) -> None:
        capture = self._capture
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.intrinsics.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.intrinsics.height)
        capture.set(cv2.CAP_PROP_FPS, fps)
        # What waits in the driver's queue is old.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        # Drivers disagree: V4L2 has 1 for manual and counts 100 us, Windows has 0.25 and powers of two.
        if sys.platform == "win32":
            capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, 0.25)
            capture.set(cv2.CAP_PROP_EXPOSURE, float(np.round(np.log2(self._exposure))))
        else:
            capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, 1)
            capture.set(cv2.CAP_PROP_EXPOSURE, self._exposure * 1e4)
