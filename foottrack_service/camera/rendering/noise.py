"""Noise from a bank: drawing half a million normal numbers a picture would cost more than the picture."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

_MARGIN = 256


class NoiseBank:
    """Fields of unit normal noise, (h, w), cut at random from larger ones."""

    def __init__(self, height: int, width: int, seed: int) -> None:
        self._shape = (height, width)
        self._source = np.random.default_rng(seed)
        size = (height + _MARGIN, width + _MARGIN)
        self._fine = self._source.standard_normal(size, dtype=np.float32)
        coarse = cv2.GaussianBlur(self._source.standard_normal(size, dtype=np.float32), (0, 0), 2.0)
        self._coarse = coarse / coarse.std()
        patches = cv2.GaussianBlur(self._source.standard_normal(size, dtype=np.float32), (0, 0), 5.0)
        self._patches = patches / patches.std()

    def fine(self) -> npt.NDArray[np.float32]:
        """Independent from pixel to pixel."""
        return self._cut(self._fine)

    def coarse(self) -> npt.NDArray[np.float32]:
        """Correlated over some 5 px, as a stereo matcher's disparities are."""
        return self._cut(self._coarse)

    def patches(self) -> npt.NDArray[np.float32]:
        """Correlated over some 12 px."""
        return self._cut(self._patches)

    def apply(self, picture: npt.NDArray[np.uint8], read: float, shot: float) -> npt.NDArray[np.uint8]:
        """The picture with noise of variance read^2 + shot * grey."""
        sigma = np.sqrt(read * read + shot * np.arange(256)).astype(np.float32)
        noise = cv2.multiply(cv2.LUT(picture, sigma), self.fine())
        return np.asarray(cv2.add(picture, noise, dtype=cv2.CV_8U))

    def _cut(self, field: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        y, x = self._source.integers(0, _MARGIN, 2)
        return field[y : y + self._shape[0], x : x + self._shape[1]]
