"""Finds the shoes in the depth picture: the depth blob of [B], without the floor.

As in [B]: what lies in range around the last depth is opened, outlined, boxed, and the box nearest to the last
position is the shoe, at the depth of its nearest valid pixels. One thing is added: the floor is taken out by its plane,
since a camera that looks down at a slant has it in range too. What is told is the box's middle, which is not the tag's.
The difference turns with the foot, so fusion, which knows the foot's attitude, learns it: for that blobs are told now
and then while the tag is seen, and in every picture while it is not.
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
from foottrack_service.camera.ranging import DEPTH_NOISE
from foottrack_service.camera.rig import Rig
from foottrack_service.rotations import Array

FORGET_S = 2.0
"""How long a shoe is expected where neither tag nor blob has shown it: a foot that leaves the picture comes back."""
LOOK_PERIOD_S = 0.2
"""Between two blobs of a shoe whose tag is seen: looking costs as much as finding the tag."""
RANGE_M = 0.15
"""Depth around the last one that may be the shoe."""
REACH_M = 0.11
"""How far the blob may be from where it was last."""
SIGMA_M = 0.004
"""Standard deviation of a blob's middle across the line of sight, from picture to picture (rendered walks)."""

_STRIDE = 2
"""Every second pixel both ways shows as much of a shoe at a quarter of the cost."""
_WINDOW_M = 0.32
_ABOVE_FLOOR_M = 0.02
_LOW_M, _TALL_M = 0.05, 0.09
"""Height of a standing shoe's middle, and of the shoe above it, where the leg begins."""
_GOES_ON_S = 0.1
"""How long what is not seen is expected to keep its pace."""
_LEAST_AREA_M2 = 0.003
_LEARN = 0.3


@dataclass
class _Shoe:
    """One side, OpenCV's camera frame: its tag's place `p` and `v` at `t`, as seen or by the blob; `offset` to that."""

    t: int
    p: Array
    v: Array
    offset: Array
    looked: int


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
        """Blobs of the sides that have no fix in `markers` but had one not long ago, and of one more, if it is due."""
        if frame.depth is None:
            return []
        self._shoes = {side: s for side, s in self._shoes.items() if 0 <= frame.t - s.t < FORGET_S * 1e9}
        seen = {fix.side: self._rig.from_head(fix.p) for fix in markers}
        for side, p in seen.items():
            self._follow(side, p, frame.t)
        due = [side for side in self._shoes if side not in seen]
        idle = [side for side in seen if not 0 <= frame.t - self._shoes[side].looked < LOOK_PERIOD_S * 1e9]
        due += sorted(idle, key=lambda side: self._shoes[side].looked)[:1]
        if not due:
            return []
        self._floor = find_floor(frame, self._rig.intrinsics, self._floor)
        blobs = {side: blob for side in due if (blob := self._find(frame, self._shoes[side])) is not None}
        blobs = {side: blob for side, blob in blobs.items() if not self._is_others(side, blob)}
        for side, blob in blobs.items():
            shoe = self._shoes[side]
            if side in seen:
                shoe.offset = shoe.offset + _LEARN * (blob.p - shoe.p - shoe.offset)
            else:
                self._follow(side, blob.p - shoe.offset, frame.t)
        return [self._fix(side, blob, frame) for side, blob in blobs.items()]

    def _follow(self, side: str, p: Array, t: int) -> None:
        shoe = self._shoes.get(side)
        if shoe is None:
            self._shoes[side] = _Shoe(t, p, np.zeros(3), np.zeros(3), -(2**62))
            return
        dt = (t - shoe.t) * 1e-9
        if dt > 0.0:
            shoe.v = 0.5 * shoe.v + 0.5 * np.clip((p - shoe.p) / dt, -6.0, 6.0)
        shoe.t, shoe.p = t, p

    def _find(self, frame: Frame, shoe: _Shoe) -> _Blob | None:
        shoe.looked = frame.t
        age = (frame.t - shoe.t) * 1e-9
        expected = shoe.p + shoe.v * min(age, _GOES_ON_S) + shoe.offset
        depth = frame.depth
        if depth is None or expected[2] < 0.2:
            return None
        intrinsics = self._rig.intrinsics
        centre = intrinsics.project(expected[None])[0]
        half = _WINDOW_M * intrinsics.focal / expected[2]
        low = np.maximum(centre - half, 0).astype(int)
        high = np.minimum(centre + half + 1, depth.shape[::-1]).astype(int)
        if np.any(high - low < 4 * _STRIDE):
            return None
        z = depth[low[1] : high[1] : _STRIDE, low[0] : high[0] : _STRIDE] * np.float32(frame.depth_unit)
        near = cv2.inRange(z, float(expected[2]) - RANGE_M, float(expected[2]) + RANGE_M)
        if self._floor is not None:
            above = _height_above(self._floor, z, low, self._rig)
            top = max(_LOW_M, float(self._floor.above(expected))) + _TALL_M
            near = cv2.bitwise_and(near, cv2.inRange(above, _ABOVE_FLOOR_M, top))
        mask = np.asarray(cv2.morphologyEx(near, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8)), dtype=np.uint8)
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        best: tuple[float, _Blob] | None = None
        least = _LEAST_AREA_M2 * (intrinsics.focal / expected[2] / _STRIDE) ** 2
        for outline in outlines:
            if cv2.contourArea(outline) < least:
                continue
            blob = self._measure(np.asarray(outline), mask, z, low)
            distance = float(np.linalg.norm(blob.p - expected))
            if distance < REACH_M * (1.0 + age) and (best is None or distance < best[0]):
                best = (distance, blob)
        return None if best is None else best[1]

    def _measure(
        self, outline: npt.NDArray[Any], mask: npt.NDArray[np.uint8], z: npt.NDArray[np.float32], low: Array
    ) -> _Blob:
        box = cv2.minAreaRect(outline)
        middle = np.asarray(box[0])
        rows, columns = np.nonzero(mask)
        near = np.argsort((columns - middle[0]) ** 2 + (rows - middle[1]) ** 2)[:9]
        depth = float(np.median(z[rows[near], columns[near]]))
        ray = self._rig.intrinsics.rays((_STRIDE * middle + low)[None])[0]
        corners = _STRIDE * np.asarray(cv2.boxPoints(box), dtype=np.float64) + low
        return _Blob(np.array([ray[0], ray[1], 1.0]) * depth, corners)

    def _is_others(self, side: str, blob: _Blob) -> bool:
        own = float(np.linalg.norm(blob.p - self._shoes[side].p - self._shoes[side].offset))
        return any(
            float(np.linalg.norm(blob.p - other.p - other.offset)) < min(own, 0.10)
            for name, other in self._shoes.items()
            if name != side
        )

    def _fix(self, side: str, blob: _Blob, frame: Frame) -> Fix:
        height, width = frame.gray.shape
        return Fix(
            side=side,
            kind="depth",
            t=frame.t,
            frame=frame.number,
            p=self._rig.to_head(blob.p),
            q=None,
            q_alt=None,
            cov=self._rig.covariance_to_head(np.diag([SIGMA_M**2, SIGMA_M**2, (DEPTH_NOISE * blob.p[2] ** 2) ** 2])),
            size_ratio=None,
            reproj_px=None,
            edge_px=edge_distance(blob.outline, width, height),
            outline=blob.outline,
            label=f"{side} depth {blob.p[2]:.2f} m",
        )


def _height_above(floor: Plane, z: npt.NDArray[np.float32], low: Array, rig: Rig) -> npt.NDArray[np.float32]:
    """Height over the floor of every pixel of a window (h, w) of depth, m. Lens distortion is left out."""
    lens = rig.intrinsics
    columns = (low[0] + _STRIDE * np.arange(z.shape[1]) - lens.cx) / lens.fx * floor.normal[0]
    rows = (low[1] + _STRIDE * np.arange(z.shape[0]) - lens.cy) / lens.fy * floor.normal[1]
    along = (rows[:, None] + (columns + floor.normal[2])[None]).astype(np.float32)
    return np.asarray(z * along + np.float32(floor.height), dtype=np.float32)
