"""Follows a shoe in the depth picture while its tag is lost: the depth blob of [B], without the floor.

As in [B]: what lies in range around the last depth is opened, outlined, boxed, and the box nearest to the last
position is the shoe, at the depth of its nearest valid pixels. Two things are added. The floor is taken out by its
plane, since a camera that looks down at a slant has it in range too; and the box's middle is not the tag, so the
difference is learned while both are seen, and taken off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from foottrack_service.camera.fix import Fix, edge_distance
from foottrack_service.camera.floor import Plane, find_floor
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.rig import Rig
from foottrack_service.rotations import Array

FORGET_S = 0.5
"""How long a shoe is followed that neither tag nor blob has shown."""
RANGE_M = 0.15
"""Depth around the last one that may be the shoe."""
REACH_M = 0.11
"""How far the blob may be from the last position."""

_WINDOW_M = 0.32
_ABOVE_FLOOR_M = (0.02, 0.16)
_LEAST_AREA_M2 = 0.003
_LEARN = 0.1
_FIRST_SIGMA_M = 0.03
_LEAST_SIGMA_M = 0.012
_DRIFT_M_S = 0.03
"""The difference turns with the foot, so what was learned ages."""


@dataclass
class _Shoe:
    """One side, OpenCV's camera frame: `p`, `v` at `t`; `offset` box to target, its variance per axis; when learned."""

    t: int
    p: Array
    v: Array
    offset: Array
    variance: Array
    learned: int


@dataclass(frozen=True)
class _Blob:
    p: Array
    outline: Array


class DepthTracker:
    """One per camera, beside a MarkerTracker whose fixes of the same picture it is given."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._shoes: dict[str, _Shoe] = {}
        self._floor: Plane | None = None

    def process(self, frame: Frame, markers: Sequence[Fix]) -> list[Fix]:
        """Depth fixes of the sides that have none in `markers` and had one not long ago."""
        if frame.depth is None:
            return []
        self._shoes = {side: s for side, s in self._shoes.items() if 0 <= frame.t - s.t < FORGET_S * 1e9}
        seen = {fix.side: self._rig.from_head(fix.p) for fix in markers}
        if not seen and not self._shoes:
            return []
        self._floor = find_floor(frame, self._rig.intrinsics, self._floor)
        for side, p in seen.items():
            self._learn(side, p, frame)
        lost = [side for side in self._shoes if side not in seen]
        blobs = {side: self._find(frame, self._shoes[side]) for side in lost}
        return [
            self._fix(side, blob, frame)
            for side, blob in blobs.items()
            if blob is not None and not self._is_others(side, blob)
        ]

    def _learn(self, side: str, p: Array, frame: Frame) -> None:
        known = self._shoes.get(side)
        if known is None:
            wide = np.full(3, _FIRST_SIGMA_M**2)
            self._shoes[side] = _Shoe(frame.t, p, np.zeros(3), np.zeros(3), wide, frame.t)
            return
        self._move(known, p, frame.t)
        # Every other picture is enough, and halves what this costs while nobody needs it.
        blob = self._find(frame, known) if frame.number % 2 == 0 else None
        if blob is not None:
            error = p - blob.p - known.offset
            known.offset = known.offset + _LEARN * error
            known.variance = known.variance + _LEARN * (error**2 - known.variance)
            known.learned = frame.t

    def _move(self, shoe: _Shoe, p: Array, t: int) -> None:
        dt = (t - shoe.t) * 1e-9
        if dt > 0.0:
            shoe.v = 0.5 * shoe.v + 0.5 * np.clip((p - shoe.p) / dt, -6.0, 6.0)
        shoe.t, shoe.p = t, p

    def _find(self, frame: Frame, shoe: _Shoe) -> _Blob | None:
        expected = shoe.p + shoe.v * ((frame.t - shoe.t) * 1e-9)
        depth = frame.depth
        if depth is None or expected[2] < 0.2:
            return None
        intrinsics = self._rig.intrinsics
        centre = intrinsics.project(expected[None])[0]
        half = _WINDOW_M * intrinsics.focal / expected[2]
        low = np.maximum(centre - half, 0).astype(int)
        high = np.minimum(centre + half + 1, depth.shape[::-1]).astype(int)
        if np.any(high - low < 4):
            return None
        z = depth[low[1] : high[1], low[0] : high[0]] * np.float32(frame.depth_unit)
        near = cv2.inRange(z, float(expected[2]) - RANGE_M, float(expected[2]) + RANGE_M)
        if self._floor is not None:
            above = _height_above(self._floor, z, low, self._rig)
            near = cv2.bitwise_and(near, cv2.inRange(above, *_ABOVE_FLOOR_M))
        mask = np.asarray(cv2.morphologyEx(near, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8)), dtype=np.uint8)
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        best: tuple[float, _Blob] | None = None
        least = _LEAST_AREA_M2 * (intrinsics.focal / expected[2]) ** 2
        for outline in outlines:
            if cv2.contourArea(outline) < least:
                continue
            blob = self._measure(np.asarray(outline), mask, z, low)
            distance = float(np.linalg.norm(blob.p + shoe.offset - expected))
            if distance < REACH_M and (best is None or distance < best[0]):
                best = (distance, blob)
        return None if best is None else best[1]

    def _measure(
        self, outline: npt.NDArray[Any], mask: npt.NDArray[np.uint8], z: npt.NDArray[np.float32], low: Array
    ) -> _Blob:
        box = cv2.minAreaRect(outline)
        middle = np.asarray(box[0])
        rows, columns = np.nonzero(mask)
        near = np.argsort((columns - middle[0]) ** 2 + (rows - middle[1]) ** 2)[:25]
        depth = float(np.median(z[rows[near], columns[near]]))
        ray = self._rig.intrinsics.rays((middle + low)[None])[0]
        return _Blob(np.array([ray[0], ray[1], 1.0]) * depth, np.asarray(cv2.boxPoints(box), dtype=np.float64) + low)

    def _is_others(self, side: str, blob: _Blob) -> bool:
        place = blob.p + self._shoes[side].offset
        own = float(np.linalg.norm(place - self._shoes[side].p))
        return any(
            float(np.linalg.norm(place - other.p)) < min(own, 0.10)
            for name, other in self._shoes.items()
            if name != side
        )

    def _fix(self, side: str, blob: _Blob, frame: Frame) -> Fix:
        shoe = self._shoes[side]
        p = blob.p + shoe.offset
        age = (frame.t - shoe.learned) * 1e-9
        sigma2 = np.maximum(shoe.variance, _LEAST_SIGMA_M**2) + (_DRIFT_M_S * age) ** 2
        self._move(shoe, p, frame.t)
        height, width = frame.gray.shape
        return Fix(
            side=side,
            kind="depth",
            t=frame.t,
            frame=frame.number,
            p=self._rig.to_head(p),
            q=None,
            q_alt=None,
            cov=self._rig.covariance_to_head(np.diag(sigma2)),
            size_ratio=None,
            reproj_px=None,
            edge_px=edge_distance(blob.outline, width, height),
            outline=blob.outline,
            label=f"{side} depth {p[2]:.2f} m",
        )


def _height_above(floor: Plane, z: npt.NDArray[np.float32], low: Array, rig: Rig) -> npt.NDArray[np.float32]:
    """Height over the floor of every pixel of a window (h, w) of depth, m. Lens distortion is left out."""
    lens = rig.intrinsics
    columns = (np.arange(low[0], low[0] + z.shape[1]) - lens.cx) / lens.fx * floor.normal[0]
    rows = (np.arange(low[1], low[1] + z.shape[0]) - lens.cy) / lens.fy * floor.normal[1]
    along = (rows[:, None] + (columns + floor.normal[2])[None]).astype(np.float32)
    return np.asarray(z * along + np.float32(floor.height), dtype=np.float32)
