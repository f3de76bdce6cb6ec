"""What stands where in the simulated camera's pictures: projection, field of view, occlusion by legs, motion blur."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.config import Placement, Settings, TargetSettings
from foottrack_service.rotations import Array
from foottrack_service.simulation.anatomy import knees, person
from foottrack_service.simulation.faults import Fault, MountSlipped
from foottrack_service.simulation.truth import BOTH, Flags, Truth

# D435 data sheet (337029): 848x480 is its best depth resolution; f as the thesis' colour stream has it.
FPS = 60.0
WIDTH, HEIGHT, FOCAL = 848, 480, 612.0  # px
BASELINE = 0.050  # m, between the two infrared eyes
EXPOSURE_S = 0.003
READOUT_S = 0.010  # s from the first row to the last: the colour sensor's shutter rolls
_GRAZING = math.cos(math.radians(75.0))  # a tag seen flatter than that is no tag
# m: half of an adult's ankle and knee breadth and of the thigh near the hip, from usual girths (0.22, 0.33, 0.55 m).
_ANKLE_RADIUS, _KNEE_RADIUS, _HIP_RADIUS = 0.035, 0.052, 0.088


@dataclass(frozen=True)
class Eye:
    """The camera in the stage at times (n,), s."""

    t: Array
    p: Array
    q: Array


@dataclass(frozen=True)
class TagView:
    """One tag in n pictures, camera frame (-Z into the picture, +Y up)."""

    corners: Array
    """(n, 4, 2) px, u to the right, v down."""
    facing: Array
    """(n,) cosine between the tag's normal and the way to the camera."""
    size_px: Array
    """(n,) root of the area in the picture."""
    inside: Flags
    """All corners in the picture, and seen from the front."""
    hidden: Flags
    """Behind a leg."""
    blur_px: Array
    """(n,) movement in the picture during the exposure."""

    @property
    def edge_px(self) -> Array:
        """(n,) least distance of a corner to the picture's border."""
        u, v = self.corners[..., 0], self.corners[..., 1]
        borders: Array = np.minimum(np.minimum(u, WIDTH - u), np.minimum(v, HEIGHT - v)).min(axis=-1)
        return borders


def eye(truth: Truth, t: Array, mount: Placement, faults: Sequence[Fault]) -> Eye:
    """Where the camera really is: on the mount as configured, and as it slipped since."""
    head_p, head_q = truth.head.pose(t)
    p = np.tile(np.asarray(mount.p), (len(t), 1))
    q = np.tile(rotations.normalised(mount.q), (len(t), 1))
    for fault in faults:
        if isinstance(fault, MountSlipped):
            slipped = fault.covers(t)
            p[slipped] += fault.shift
            q[slipped] = rotations.multiply(q[slipped], rotations.from_rotation_vector(fault.turn))
    return Eye(t, head_p + rotations.rotate(head_q, p), rotations.multiply(head_q, q))


def row_times(
    truth: Truth, middle: Array, point: tuple[Side, Array], mount: Placement, faults: Sequence[Fault]
) -> Array:
    """Mid-exposure (n,), s, of the rows on which a foot's point (3,) falls; `middle` (n,) of the middle rows."""
    side, r = point
    t = middle
    for _ in range(2):
        uv, depth = project(eye(truth, t, mount, faults), truth.feet[side].point(t, r))
        row = np.where(depth > 0.05, np.clip(uv[..., 1], 0.0, HEIGHT), 0.5 * HEIGHT)
        t = middle + (row / HEIGHT - 0.5) * READOUT_S
    return t


def project(camera: Eye, points: Array) -> tuple[Array, Array]:
    """Pixels (n, 2) and depths (n,), m, of stage points (n, 3). Pixels mean nothing where the depth is not positive."""
    local = rotations.unrotate(camera.q, points - camera.p)
    return _pixels(local), -local[..., 2]


def tag_views(truth: Truth, side: Side, settings: Settings, camera: Eye, faults: Sequence[Fault]) -> list[TagView]:
    """All tags of one shoe, each in the n pictures of `camera`."""
    target = settings.camera.targets.of(side)
    placed = settings.feet.of(side).marker
    views = []
    before = _tag_corners(truth, side, placed, target, camera.t - 0.5 * EXPOSURE_S)
    after = _tag_corners(truth, side, placed, target, camera.t + 0.5 * EXPOSURE_S)
    first = eye(truth, camera.t - 0.5 * EXPOSURE_S, settings.camera.mount, faults)
    last = eye(truth, camera.t + 0.5 * EXPOSURE_S, settings.camera.mount, faults)
    for index, stage in enumerate(_tag_corners(truth, side, placed, target, camera.t)):
        local = rotations.unrotate(camera.q[:, None], stage - camera.p[:, None])
        corners = _pixels(local)
        ahead = np.all(local[..., 2] < -0.05, axis=-1)
        right, up = local[:, 1] - local[:, 0], local[:, 0] - local[:, 3]
        normal = np.cross(right, up)
        middle = local.mean(axis=1)
        facing = -np.sum(normal * middle, axis=-1) / (np.linalg.norm(normal, axis=-1) * np.linalg.norm(middle, axis=-1))
        d1, d2 = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        area = 0.5 * np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0])
        u, v = corners[..., 0], corners[..., 1]
        framed = np.all((u > 0.0) & (u < WIDTH) & (v > 0.0) & (v < HEIGHT), axis=-1)
        shift = project(last, after[index].mean(axis=1))[0] - project(first, before[index].mean(axis=1))[0]
        views.append(
            TagView(
                corners,
                facing,
                np.sqrt(area),
                ahead & framed & (facing > _GRAZING),
                hidden(truth, stage.mean(axis=1), camera, settings),
                np.linalg.norm(shift, axis=-1),
            )
        )
    return views


def hidden(truth: Truth, points: Array, camera: Eye, settings: Settings) -> Flags:
    """Whether one of the wearer's legs stands between the camera and the stage points (n, 3)."""
    behind = np.zeros(len(points), dtype=np.bool_)
    if truth.hips is None:
        return behind
    wearer = person(settings.body, settings.feet.left.ankle_height)
    hips_p, hips_q = truth.hips.pose(camera.t)
    for side, lateral in zip(BOTH, (-0.5, 0.5), strict=True):
        ankle, foot_q = truth.feet[side].pose(camera.t)
        hip = hips_p + rotations.rotate(hips_q, [lateral * wearer.hip_spacing, 0.0, 0.0])
        yaw = rotations.yaw_of(foot_q)
        forward = rotations.rotate(rotations.from_yaw(yaw), [0.0, 0.0, -1.0])
        knee = knees(hip, ankle, forward, wearer)
        behind |= _clearance(camera.p, points, ankle, knee, (_ANKLE_RADIUS, _KNEE_RADIUS)) < 0.0
        behind |= _clearance(camera.p, points, knee, hip, (_KNEE_RADIUS, _HIP_RADIUS)) < 0.0
    return behind


def cells_across(dictionary: str | Sequence[str]) -> int:
    """Cells of a tag from border to border, by the dictionary's name, or by its own tags written out row by row."""
    if not isinstance(dictionary, str):
        return math.isqrt(len(dictionary[0])) + 2
    named = re.search(r"(\d)X\d", dictionary)
    if named is not None:
        return int(named[1]) + 2
    return {"DICT_APRILTAG_16h5": 6, "DICT_APRILTAG_25h9": 7, "DICT_ARUCO_ORIGINAL": 7}.get(dictionary, 8)


def _tag_corners(truth: Truth, side: Side, placed: Placement, target: TargetSettings, t: Array) -> list[Array]:
    """Per tag (n, 4, 3) m, stage, in OpenCV's order: top left, top right, bottom right, bottom left."""
    p, q = truth.feet[side].pose(t)
    placed_q = rotations.normalised(placed.q)
    found = []
    for tag in target.tags:
        half = 0.5 * tag.size
        square = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
        on_target = rotations.rotate(rotations.normalised(tag.q), square) + tag.p
        on_foot = rotations.rotate(placed_q, on_target) + placed.p
        found.append(p[:, None] + rotations.rotate(q[:, None], on_foot))
    return found


def _pixels(local: Array) -> Array:
    depth = np.where(local[..., 2] < -0.05, -local[..., 2], 0.05)
    return np.stack(
        [0.5 * WIDTH + FOCAL * local[..., 0] / depth, 0.5 * HEIGHT - FOCAL * local[..., 1] / depth], axis=-1
    )


def _clearance(a: Array, b: Array, c: Array, d: Array, radii: tuple[float, float]) -> Array:
    """(n,) m between the line a-b and a limb c-d with these radii at its ends, all (n, 3).

    The nearest points of two segments as in Ericson, Real-Time Collision Detection, 5.1.9.
    """
    u, v, w = b - a, d - c, a - c
    uu, vv = np.sum(u * u, axis=-1), np.sum(v * v, axis=-1)
    uv, uw, vw = np.sum(u * v, axis=-1), np.sum(u * w, axis=-1), np.sum(v * w, axis=-1)
    spread = np.maximum(uu * vv - uv * uv, 1e-12)
    s = np.clip((uv * vw - uw * vv) / spread, 0.0, 1.0)
    t = np.clip((uv * s + vw) / vv, 0.0, 1.0)
    s = np.clip((uv * t - uw) / uu, 0.0, 1.0)
    gap = w + s[:, None] * u - t[:, None] * v
    return np.asarray(np.linalg.norm(gap, axis=-1) - radii[0] - t * (radii[1] - radii[0]))
