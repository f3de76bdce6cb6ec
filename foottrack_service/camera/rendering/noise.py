"""Noise from a bank: drawing half a million normal numbers a picture would cost more than the picture."""

from __future__ import annotations

from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

_MARGIN = 256
Field = npt.NDArray[np.float32]


class NoiseBank:
    """Fields of unit normal noise, (h, w), cut at random from larger ones."""

    def __init__(self, height: int, width: int, seed: int) -> None:
        self._shape = (height, width)
        self._source = np.random.default_rng(seed)
        self._fine = self._field(None)

    @cached_property
    def _coarse(self) -> Field:
        return self._field(2.0)

    @cached_property
    def _patches(self) -> Field:
        return self._field(5.0)

    def fine(self) -> Field:
        """Independent from pixel to pixel."""
        return self._cut(self._fine)

    def coarse(self) -> Field:
        """Correlated over some 5 px, as a stereo matcher's disparities are."""
        return self._cut(self._coarse)

    def patches(self) -> Field:
        """Correlated over some 12 px."""
        return self._cut(self._patches)

    def apply(self, picture: npt.NDArray[np.uint8], read: float, shot: float) -> npt.NDArray[np.uint8]:
        """The picture with noise of variance read^2 + shot * grey."""
        sigma = np.sqrt(read * read + shot * np.arange(256)).astype(np.float32)
        noise = cv2.multiply(cv2.LUT(picture, sigma), self.fine())
        return np.asarray(cv2.add(picture, noise, dtype=cv2.CV_8U))

    def _field(self, blur: float | None) -> Field:
        size = (self._shape[0] + _MARGIN, self._shape[1] + _MARGIN)
        field = self._source.standard_normal(size, dtype=np.float32)
        if blur is None:
            return field
        smooth = np.asarray(cv2.GaussianBlur(field, (0, 0), blur), dtype=np.float32)
        return np.asarray(smooth / smooth.std(), dtype=np.float32)

    def _cut(self, field: Field) -> Field:
        y, x = self._source.integers(0, _MARGIN, 2)
        return field[y : y + self._shape[0], x : x + self._shape[1]]
