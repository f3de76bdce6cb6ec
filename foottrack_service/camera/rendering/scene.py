"""What stands in the simulated camera's picture: a floor, two shoes with a bit of leg, and their tags."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from foottrack_service import rotations
from foottrack_service.camera.dictionaries import tag_cells
from foottrack_service.camera.rendering.motion import PoseTrack
from foottrack_service.camera.targets import Target
from foottrack_service.rotations import Array

FLOOR_TILE_M = 4.0
_FLOOR_PX = 2048
_TAG_PX_PER_CELL = 24
_HEAD_TO_HIP_M = 0.78
_SHIN_M = 0.43
PAPER, INK = 205, 32
"""Grey levels of the print."""


@dataclass(frozen=True)
class Solid:
    """A convex body: `points` (n, 3) m in the foot's frame, `faces` outward counter-clockwise, with grey levels."""

    points: Array
    faces: tuple[tuple[int, ...], ...]
    grey: tuple[int, ...]


@dataclass(frozen=True)
class Sheet:
    """A printed tag with its white margin: `points` (4, 3) in the foot's frame, and mipmaps of the print."""

    points: Array
    textures: tuple[npt.NDArray[np.uint8], ...]
    faces: tuple[tuple[int, ...], ...] = ((3, 2, 1, 0),)


Part = Solid | Sheet


@dataclass(frozen=True)
class Shoe:
    """One foot as the camera sees it, drawn in this order: sole and toes, tags, ankle, and the shin that hides them.

    All in the foot's frame but the shin, which has its origin at the ankle too and +Y towards the knee. The hem of
    a trouser leg may lie over the tags.
    """

    last: Solid
    sheets: tuple[Sheet, ...]
    upper: Solid
    shin: Solid
    hem: Solid

    def parts(self, covered: bool) -> tuple[Part, ...]:
        """What moves with the foot, in the order of drawing."""
        return (self.last, *self.sheets, self.upper, *([self.hem] if covered else []))


@dataclass(frozen=True)
class Scene:
    """Shoes with their motion, the head with its own, stage frame."""

    head: PoseTrack
    feet: Mapping[str, PoseTrack]
    shoes: Mapping[str, Shoe]
    floor_height: float = 0.0
    covered: Sequence[tuple[float, float]] = ()
    """When the tags are covered, s: [begin, end)."""

    def is_covered(self, t: float) -> bool:
        """Whether hems hang over the tags at `t`, s."""
        return any(begin <= t < end for begin, end in self.covered)


def make_shoe(
    target: Target,
    dictionary: Any,
    marker_p: Sequence[float],
    marker_q: Sequence[float],
    ankle_height: float = 0.09,
) -> Shoe:
    """A shoe whose target frame sits at `marker_p` (m), `marker_q` in the foot's frame, sole `ankle_height` below."""
    sheets = []
    for tag in target.tags:
        cells = tag_cells(dictionary, tag.id)
        margin = tag.size / cells.shape[0]
        grown = 1.0 + 2.0 * margin / tag.size
        square = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
        local = rotations.rotate(rotations.normalised(tag.q), 0.5 * tag.size * grown * square) + np.asarray(tag.p)
        corners = rotations.rotate(rotations.normalised(marker_q), local) + np.asarray(marker_p)
        sheets.append(Sheet(corners, _print(cells)))
    low, step = -ankle_height, -ankle_height + 0.04
    last = _prism([(0.07, low), (0.07, step), (-0.10, step), (-0.20, low + 0.025), (-0.20, low)], 0.045, 95)
    upper = _prism([(0.07, step), (0.06, 0.03), (-0.03, 0.03), (-0.085, step)], 0.04, 70)
    shin = _prism([(0.045, 0.02), (0.06, 0.28), (-0.05, 0.28), (-0.035, 0.02)], 0.045, 55)
    hem = _prism([(-0.085, step), (-0.085, step + 0.016), (-0.21, step + 0.016), (-0.21, step)], 0.05, 60)
    return Shoe(last, tuple(sheets), upper, shin, hem)


def shin_of(head: PoseTrack, foot: PoseTrack) -> PoseTrack:
    """Where the shin goes: towards a knee that bends forward as far as the way from ankle to hip demands.

    Hips are 0.78 m straight below the head, shin and thigh 0.43 m.
    """

    def track(t: Array) -> tuple[Array, Array]:
        p, q = foot(t)
        way = head(t)[0] - (0.0, _HEAD_TO_HIP_M, 0.0) - p
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        ahead = rotations.rotate(rotations.from_yaw(rotations.yaw_of(q)), (0.0, 0.0, -1.0))
        along = way / np.maximum(length, 1e-6)
        side = _unit(np.cross(ahead, along))
        bend = np.arccos(np.clip(0.5 * length / _SHIN_M, 0.2, 1.0))
        up = along * np.cos(bend) + np.cross(along, side) * -np.sin(bend)
        back = np.cross(side, up)
        return p, rotations.from_matrix(np.stack([side, up, back], axis=-1))

    return track


def _unit(v: Array) -> Array:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9))


@lru_cache(maxsize=2)
def floor_texture(seed: int) -> npt.NDArray[np.uint8]:
    """Grey carpet over FLOOR_TILE_M square: noise of several grains and a few seams, so that edges abound."""
    source = np.random.default_rng(seed)
    texture = np.full((_FLOOR_PX, _FLOOR_PX), 118.0, dtype=np.float32)
    for size, amplitude in ((16, 12.0), (64, 10.0), (512, 9.0), (_FLOOR_PX, 8.0)):
        grain = source.standard_normal((size, size)).astype(np.float32)
        texture += amplitude * cv2.resize(grain, (_FLOOR_PX, _FLOOR_PX), interpolation=cv2.INTER_LINEAR)
    for line in range(0, _FLOOR_PX, _FLOOR_PX // 10):
        texture[line : line + 3] -= 35.0
        texture[:, line : line + 3] -= 20.0
    return np.clip(texture, 5, 250).astype(np.uint8)


def _print(cells: npt.NDArray[np.uint8]) -> tuple[npt.NDArray[np.uint8], ...]:
    paper = np.where(np.pad(cells, 1, constant_values=1) == 1, PAPER, INK).astype(np.uint8)
    level = np.kron(paper, np.ones((_TAG_PX_PER_CELL, _TAG_PX_PER_CELL), dtype=np.uint8))
    levels = [level]
    while level.shape[0] > 2 * paper.shape[0]:
        level = np.asarray(cv2.resize(level, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
        levels.append(level)
    return tuple(levels)


def _prism(profile: Sequence[tuple[float, float]], half_width: float, grey: int) -> Solid:
    """A profile in (z, y), m, counter-clockwise seen from +X, extruded to both sides."""
    n = len(profile)
    left = [(-half_width, y, z) for z, y in profile]
    right = [(half_width, y, z) for z, y in profile]
    sides = [(i, n + i, n + (i + 1) % n, (i + 1) % n) for i in range(n)]
    faces = [tuple(range(n)), tuple(reversed(range(n, 2 * n))), *sides]
    vertices = np.array(left + right)
    centre = vertices.mean(axis=0)
    outward = []
    for face in faces:
        a, b, c = vertices[list(face[:3])]
        flips = np.dot(np.cross(b - a, c - b), vertices[list(face)].mean(axis=0) - centre) < 0.0
        outward.append(tuple(reversed(face)) if flips else face)
    # Light from above and ahead: faces of one solid differ, so its edges show.
    shades = []
    for face in outward:
        a, b, c = vertices[list(face[:3])]
        normal = np.cross(b - a, c - b)
        normal /= np.linalg.norm(normal)
        shades.append(int(np.clip(grey * (1.0 + 0.35 * normal[1] - 0.15 * normal[2]), 0, 255)))
    return Solid(vertices, tuple(outward), tuple(shades))
