"""Draws what the camera sees of a scene, with the shutter it has.

Blur comes from the motion itself: the exposure is cut into instants, and each is drawn with every corner projected
*at its own row's time*, which is the rolling shutter. Corners carry the lens distortion, surfaces between them are
straight; the floor, on which nothing is measured, has blur but neither distortion nor rolling shutter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from foottrack_service.camera.rendering.depth import DepthModel, Surface, draw_depth
from foottrack_service.camera.rendering.motion import Poses
from foottrack_service.camera.rendering.noise import NoiseBank
from foottrack_service.camera.rendering.scene import FLOOR_TILE_M, Part, Scene, Sheet, Solid, floor_texture, shin_of
from foottrack_service.camera.rig import Rig
from foottrack_service.rotations import Array

_SUPERSAMPLING = 2
_NEAR_M = 0.05
_SKY = 150
_SHIFT = 4
_DEPTH = DepthModel()


@dataclass(frozen=True)
class Shutter:
    """`exposure` s per row, `readout` s from the first row to the last (0: global shutter)."""

    exposure: float = 0.003
    readout: float = 0.010


@dataclass(frozen=True)
class PictureModel:
    """The sensor: `psf` px (standard deviation of the lens's blur), `read_noise` and `shot_noise` in grey levels.

    The variance of a pixel is read_noise^2 + shot_noise * grey.
    """

    psf: float = 0.5
    read_noise: float = 2.0
    shot_noise: float = 0.05


class Renderer:
    """Renders a scene as seen through a rig. The same seed and times give the same pictures."""

    def __init__(
        self,
        scene: Scene,
        rig: Rig,
        shutter: Shutter = Shutter(),
        picture: PictureModel = PictureModel(),
        depth: DepthModel | None = _DEPTH,
        seed: int = 0,
    ) -> None:
        self.scene, self.rig, self.shutter = scene, rig, shutter
        self._picture, self._depth = picture, depth
        self._floor = floor_texture(seed)
        self._noise = NoiseBank(rig.intrinsics.height, rig.intrinsics.width, seed + 1)

    def render(self, t: float) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint16] | None]:
        """Grey picture (h, w) and depth (h, w) uint16 in mm or None; `t` s is mid-exposure of the middle row."""
        half = 0.5 * (self.shutter.exposure + self.shutter.readout)
        head = Poses.sample(self.scene.head, t - half, t + half)
        feet = {side: Poses.sample(track, t - half, t + half) for side, track in self.scene.feet.items()}
        shins = {
            side: Poses.sample(shin_of(self.scene.head, track), t - half, t + half)
            for side, track in self.scene.feet.items()
        }
        picture = self._draw_floor(head, t)
        shoes = self.scene.shoes
        far_first = sorted(feet, key=lambda side: -self._distance(head, feet[side], t))
        covered = self.scene.is_covered(t)
        parts = {side: shoes[side].parts(covered) for side in far_first}
        for side in far_first:
            self._draw_shoe(picture, parts[side], shoes[side].shin, feet[side], shins[side], head, t)
        if self._picture.psf > 0.0:
            picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), self._picture.psf), dtype=np.uint8)
        picture = self._noise.apply(picture, self._picture.read_noise, self._picture.shot_noise)
        if self._depth is None:
            return picture, None
        surfaces: list[Surface] = []
        for side in far_first:
            foot, shin = feet[side].one(t), shins[side].one(t)
            surfaces += [(part.points, part.faces, *foot) for part in parts[side]]
            surfaces.append((shoes[side].shin.points, shoes[side].shin.faces, *shin))
        depth = draw_depth(surfaces, self._camera(*head.one(t)), self.scene.floor_height, self.rig.intrinsics)
        return picture, self._depth.spoil(depth, self.rig.intrinsics, self._noise)

    def project(self, points: Array, side: str, t: float) -> tuple[Array, Array]:
        """Truth for tests: pixels (n, 2) and row times (n,), s, of points (n, 3) of a foot, at mid-exposure."""
        half = 0.5 * (self.shutter.exposure + self.shutter.readout)
        head = Poses.sample(self.scene.head, t - half, t + half)
        foot = Poses.sample(self.scene.feet[side], t - half, t + half)
        pixels, _ = self._project(points, foot, head, t, np.zeros(1))
        return pixels[0], self._row_times(pixels[0, :, 1], t)

    def _camera(self, p_head: Array, R_head: Array) -> tuple[Array, Array]:
        """Place (3,) and rotation (3, 3), OpenCV's camera frame to stage."""
        return p_head + R_head @ np.asarray(self.rig.mount_p), R_head @ self.rig.R_cv

    def _distance(self, head: Poses, foot: Poses, t: float) -> float:
        return float(np.linalg.norm(foot.one(t)[0] - head.one(t)[0]))

    def _row_times(self, rows: Array, t: float) -> Array:
        height = self.rig.intrinsics.height
        share = np.clip(rows / (height - 1), 0.0, 1.0) - 0.5
        return np.asarray(t + share * self.shutter.readout)

    def _project(self, points: Array, foot: Poses, head: Poses, t: float, offsets: Array) -> tuple[Array, bool]:
        """Pixels (s, n, 2) of foot points (n, 3) at s instants of the exposure; whether all are before the camera."""
        times = np.broadcast_to(t + offsets[:, None], (len(offsets), len(points)))
        pixels = np.zeros((*times.shape, 2))
        # Twice: where a corner is decides its row, its row when it is seen.
        for _ in range(2 if self.shutter.readout > 0.0 else 1):
            p_foot, R_foot = foot.at(times)
            p_head, R_head = head.at(times)
            stage = p_foot + np.einsum("snij,nj->sni", R_foot, points)
            seen = np.einsum("snji,snj->sni", R_head, stage - p_head)
            cv = self.rig.from_head(seen)
            if cv[..., 2].min() < _NEAR_M:
                return pixels, False
            pixels = self.rig.intrinsics.project(cv.reshape(-1, 3)).reshape(pixels.shape)
            times = self._row_times(pixels[..., 1], t) + offsets[:, None]
        return pixels, True

    def _draw_floor(self, head: Poses, t: float) -> npt.NDArray[np.uint8]:
        intrinsics = self.rig.intrinsics
        half = 0.5 * self.shutter.exposure
        ends = np.array([t - half, t + half])
        turned = head.at(ends)[1]
        motion = intrinsics.focal * np.linalg.norm(turned[1] - turned[0]) / np.sqrt(2.0)
        passes = int(np.clip(np.ceil(motion / 2.0), 1, 4))
        instants = np.linspace(t - half, t + half, 2 * passes + 1)[1::2]
        drawn = [self._floor_at(*self._camera(*head.one(at))) for at in instants]
        if passes == 1:
            return drawn[0]
        return np.asarray(np.mean(drawn, axis=0), dtype=np.uint8)

    def _floor_at(self, place: Array, R: Array) -> npt.NDArray[np.uint8]:
        intrinsics = self.rig.intrinsics
        size = (intrinsics.width, intrinsics.height)
        to_stage = R @ np.linalg.inv(intrinsics.matrix)
        drop = self.scene.floor_height - place[1]
        scale = self._floor.shape[0] / FLOOR_TILE_M
        x = scale * (place[0] * to_stage[1] + drop * to_stage[0])
        z = scale * (place[2] * to_stage[1] + drop * to_stage[2])
        homography = np.stack([x, z, to_stage[1]])
        picture = cv2.warpPerspective(
            self._floor, homography, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_WRAP
        )
        rows, columns = np.arange(intrinsics.height), np.arange(intrinsics.width)
        fall = (to_stage[1, 1] * rows[:, None] + to_stage[1, 0] * columns[None] + to_stage[1, 2]) / drop
        if fall.min() <= 0.0:
            picture[fall <= 0.0] = _SKY
        return np.asarray(picture)

    def _draw_shoe(
        self,
        picture: npt.NDArray[np.uint8],
        parts: Sequence[Part],
        leg: Solid,
        foot: Poses,
        shin: Poses,
        head: Poses,
        t: float,
    ) -> None:
        points = np.concatenate([part.points for part in parts])
        half = 0.5 * self.shutter.exposure

        def project(offsets: Array) -> Array | None:
            on_foot, foot_visible = self._project(points, foot, head, t, offsets)
            on_shin, shin_visible = self._project(leg.points, shin, head, t, offsets)
            return np.concatenate([on_foot, on_shin], axis=1) if foot_visible and shin_visible else None

        ends = project(np.array([-half, half]))
        if ends is None:
            return
        height, width = picture.shape
        low = np.maximum(np.floor(ends.min(axis=(0, 1))) - 2, 0).astype(int)
        high = np.minimum(np.ceil(ends.max(axis=(0, 1))) + 3, (width, height)).astype(int)
        if np.any(high <= low):
            return
        blur = np.linalg.norm(ends[1] - ends[0], axis=1).max()
        count = int(np.clip(np.ceil(1.5 * blur), 1, 24))
        instants = np.linspace(-half, half, 2 * count + 1)[1::2]
        pixels = project(instants)
        if pixels is None:
            return
        pixels = (pixels - low + 0.5) * _SUPERSAMPLING - 0.5
        roi = picture[low[1] : high[1], low[0] : high[0]]
        size = (roi.shape[1] * _SUPERSAMPLING, roi.shape[0] * _SUPERSAMPLING)
        # NEAREST up and AREA down leave untouched pixels as they were.
        under = cv2.resize(roi, size, interpolation=cv2.INTER_NEAREST)
        total = np.zeros(under.shape, dtype=np.float32)
        for instant in pixels:
            canvas = np.array(under, dtype=np.uint8)
            _draw_instant(canvas, (*parts, leg), instant)
            cv2.accumulate(canvas, total)
        mean = cv2.resize(total / count, (roi.shape[1], roi.shape[0]), interpolation=cv2.INTER_AREA)
        roi[:] = np.rint(mean).astype(np.uint8)


def _draw_instant(canvas: npt.NDArray[np.uint8], parts: Sequence[Part], pixels: Array) -> None:
    """`pixels` (n, 2): the points of all parts, in the order in which they are drawn."""
    first = 0
    for part in parts:
        here = pixels[first : first + len(part.points)]
        if isinstance(part, Sheet):
            _draw_sheet(canvas, part, here)
        else:
            _draw_solid(canvas, part, here)
        first += len(part.points)


def _draw_solid(canvas: npt.NDArray[np.uint8], solid: Solid, corners: Array) -> None:
    fixed = np.rint(np.clip(corners, -4000.0, 4000.0) * (1 << _SHIFT)).astype(np.int32)
    for face, grey in zip(solid.faces, solid.grey, strict=True):
        polygon = list(face)
        if _turn(corners[polygon]) < 0.0:
            cv2.fillConvexPoly(canvas, fixed[polygon], grey, cv2.LINE_8, _SHIFT)


def _draw_sheet(canvas: npt.NDArray[np.uint8], sheet: Sheet, corners: Array) -> None:
    if _turn(corners) <= 0.0:
        return
    low = np.maximum(np.floor(corners.min(axis=0)) - 1, 0).astype(int)
    high = np.minimum(np.ceil(corners.max(axis=0)) + 2, canvas.shape[::-1]).astype(int)
    if np.any(high <= low):
        return
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max()
    texture = min((level for level in sheet.textures if level.shape[0] >= longest), key=len, default=sheet.textures[0])
    end = texture.shape[0] - 0.5
    print_corners = np.array([[-0.5, -0.5], [end, -0.5], [end, end], [-0.5, end]], dtype=np.float32)
    homography = cv2.getPerspectiveTransform(print_corners, (corners - low).astype(np.float32))
    part = canvas[low[1] : high[1], low[0] : high[0]]
    drawn = cv2.warpPerspective(
        texture,
        homography,
        part.shape[::-1],
        dst=part.copy(),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_TRANSPARENT,
    )
    part[:] = drawn


def _turn(polygon: Array) -> float:
    """Twice the signed area in the picture: positive when the corners run clockwise as seen."""
    x, y = polygon[:, 0], polygon[:, 1]
    return float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
