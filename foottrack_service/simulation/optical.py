"""What a camera node would say of the pictures: tags with noise, misses, flips and false finds, and the depth blob."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_protocol.messages import Side
from foottrack_service import rotations
from foottrack_service.config import Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation import camera, noise
from foottrack_service.simulation.camera import BASELINE, FOCAL, FPS, HEIGHT, WIDTH, TagView
from foottrack_service.simulation.faults import Fault
from foottrack_service.simulation.truth import Flags, Truth

# Corner noise of sub-pixel refined tags: 0.25 px where a window is upscaled or the tag is above 30 px, 0.47 below.
_CORNER_PX, _CORNER_SMALL_PX, _SMALL_PX = 0.25, 0.40, 20.0
_BLUR_TO_PX = 0.06  # px of corner noise for each px of motion blur, along it or not
# D400 tuning guide (Grunnet-Jepsen): RMS subpixel disparity noise of 0.05 to 0.08 px; depth noise Z^2 s / (f B).
_SUBPIXEL = 0.08
_DEPTH_SAMPLES = 4.0  # independent ones within a tag: neighbours in a stereo match are not
# D435 data sheet: depth accuracy at most 2 % at 2 m; calibrated units are nearer to this.
_DEPTH_SCALE_SD = 0.003
_LENS_PX = 0.5  # px SD of what the lens calibration leaves in the picture's corners, growing with the radius squared
_FOUND_AT_CELLS, _FOUND_WIDTH = 1.54, 0.20  # blur in cells: of 6 cm tags at 8 px blur 9 % are found, of 10 cm 85 %
_CELL_PX, _CELL_WIDTH = 2.2, 0.15  # px a cell must have
_BORDER_PX = 3.0  # OpenCV's detector takes no tag nearer to the border (minDistanceToBorder)
_MISS_SHARE = 0.01  # nothing in sight explains it
_FALSE_SHARE = 0.003  # of the pictures, per foot
_PLAUSIBLE_SHARE = 0.25  # of the false finds have the right size for their distance
_FLIP_SHARE = 0.12  # single tags: 15 to 21 % of small ones in real pictures
_LATENCY_S, _LATENCY_JITTER_S = 0.030, 0.8e-3  # s from mid-exposure to publishing
_STAMP_JITTER_SD = 0.2e-3

_LYING_SD = 0.03  # rad, and share of the size, of a tag that lies on the floor
_FACE_UP = np.array([-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])  # tag to stage
_BLOB = np.array([0.0, -0.03, -0.11])  # m, foot frame: middle of what a depth camera sees of a shoe from above
_BLOB_SD = 0.008  # m, per shoe
_BLOB_WANDER, _BLOB_TAU_S = 0.004, 0.8  # m, as the visible part changes
_BLOB_PX = 1.5  # px SD
_BLOB_MISS = 0.04
_BLOB_RADIUS_PX = 30.0


@dataclass
class OpticalSamples:
    """One foot in n pictures, in order of arrival; what was not `found` means nothing and is not published.

    Times in s, head frame as the camera's configured mount has it.
    """

    t: Array
    t_pub: Array
    p: Array
    q: Array | None
    q_alt: Array | None
    cov: Array
    """(n, 6)."""
    size_ratio: Array | None
    reproj_px: Array | None
    edge_px: Array
    frame: npt.NDArray[np.int64]
    found: Flags
    false: Flags
    """What was found is not this foot's target."""

    def kept(self, keep: npt.NDArray[np.bool_]) -> OpticalSamples:
        """Only these."""

        def part(x: Array | None) -> Array | None:
            return None if x is None else x[keep]

        return OpticalSamples(
            self.t[keep],
            self.t_pub[keep],
            self.p[keep],
            part(self.q),
            part(self.q_alt),
            self.cov[keep],
            part(self.size_ratio),
            part(self.reproj_px),
            self.edge_px[keep],
            self.frame[keep],
            self.found[keep],
            self.false[keep],
        )


@dataclass(frozen=True)
class Pictures:
    """The camera's pictures and what is the same for both feet: its own errors."""

    middle: Array
    """(n,) s, mid-exposure of the middle row."""
    t_pub: Array
    depth_scale: float
    lens: Array
    """(2, 2): px in the corner per unit of squared radius and direction."""


def pictures(seconds: float, random: np.random.Generator) -> Pictures:
    """A run of the camera."""
    middle = np.asarray((float(random.random()) + np.arange(math.ceil(seconds * FPS))) / FPS, dtype=np.float64)
    middle = middle[middle < seconds]
    t_pub = np.maximum.accumulate(middle + _LATENCY_S + random.exponential(_LATENCY_JITTER_S, len(middle)))
    lens = _LENS_PX * random.standard_normal((2, 2))
    return Pictures(middle, t_pub, 1.0 + _DEPTH_SCALE_SD * float(random.standard_normal()), lens)


def markers(
    truth: Truth, side: Side, settings: Settings, run: Pictures, faults: Sequence[Fault], random: np.random.Generator
) -> OpticalSamples:
    """What the marker tracker finds of one foot."""
    mount = settings.camera.mount
    placed = settings.feet.of(side).marker
    n = len(run.middle)
    t = camera.row_times(truth, run.middle, (side, np.asarray(placed.p)), mount, faults)
    eye = camera.eye(truth, t, mount, faults)
    views = camera.tag_views(truth, side, settings, eye, faults)
    cells = camera.cells_across(settings.camera.dictionary)
    found = np.array([_found(view, cells, random) for view in views])
    count = found.sum(axis=0)
    size_px = np.max([np.where(f, v.size_px, 1.0) for f, v in zip(found, views, strict=True)], axis=0)
    blur = np.max([np.where(f, v.blur_px, 0.0) for f, v in zip(found, views, strict=True)], axis=0)
    edge = np.min([np.where(f, v.edge_px, np.inf) for f, v in zip(found, views, strict=True)], axis=0)
    facing = np.max([np.where(f, v.facing, 0.0) for f, v in zip(found, views, strict=True)], axis=0)

    foot_p, foot_q = truth.feet[side].pose(t)
    local = rotations.unrotate(eye.q, foot_p + rotations.rotate(foot_q, placed.p) - eye.p)
    corner = np.hypot(np.where(size_px < _SMALL_PX, _CORNER_SMALL_PX, _CORNER_PX), _BLUR_TO_PX * blur)
    tags = np.maximum(count, 1)
    lateral_px = corner / np.sqrt(4.0 * tags)
    depth = np.maximum(-local[:, 2], 0.05)
    depth_sd = depth**2 * _SUBPIXEL / (FOCAL * BASELINE * np.sqrt(_DEPTH_SAMPLES * tags))
    measured, cov = _measured(local, lateral_px, depth_sd, run, random)

    q = rotations.multiply(rotations.conjugate(eye.q), rotations.multiply(foot_q, rotations.normalised(placed.q)))
    q, q_alt = _attitudes(q, local, corner / (size_px * np.sqrt(tags)), facing, random)
    flipped = random.random(n) < _FLIP_SHARE
    single = count == 1
    flip = (flipped & single)[:, None]
    q, q_alt = np.where(flip, q_alt, q), np.where(flip, q, q_alt)
    size_sd = np.hypot(corner / (size_px * np.sqrt(2.0)), depth_sd / depth)
    ratio = run.depth_scale + size_sd * random.standard_normal(n)
    reproj = corner * np.sqrt(random.chisquare(2.0, n) / 8.0)

    mount_q = rotations.normalised(mount.q)
    samples = OpticalSamples(
        t + _STAMP_JITTER_SD * random.standard_normal(n),
        run.t_pub,
        np.asarray(mount.p) + rotations.rotate(mount_q, measured),
        rotations.normalised(rotations.multiply(mount_q, q)),
        rotations.normalised(rotations.multiply(mount_q, q_alt)),
        _turned(cov, mount_q),
        np.maximum(ratio, 0.0),
        reproj,
        edge,
        np.arange(n, dtype=np.int64),
        count > 0,
        np.zeros(n, dtype=np.bool_),
    )
    spots = np.stack([random.uniform(20.0, WIDTH - 20.0, n), random.uniform(20.0, HEIGHT - 20.0, n)], axis=-1)
    false = random.random(n) < _FALSE_SHARE
    put_false(samples, false, spots, truth, settings, random)
    return samples


def put_false(
    samples: OpticalSamples, where: Flags, spots: Array, truth: Truth, settings: Settings, random: np.random.Generator
) -> None:
    """Replace finds by false ones: something at the pixels `spots` (n, 2), on the floor, that looks like a tag."""
    n = len(samples.t)
    turn = rotations.normalised(random.standard_normal((n, 4)))
    other_turn = rotations.normalised(random.standard_normal((n, 4)))
    plausible = random.random(n) < _PLAUSIBLE_SHARE
    ratio = np.where(plausible, 1.0 + 0.05 * random.standard_normal(n), np.exp(random.uniform(-1.0, 1.0, n)))
    height = 0.01 * random.random(n)
    if not where.any():
        return
    mount = settings.camera.mount
    mount_q = rotations.normalised(mount.q)
    head_p, head_q = truth.head.pose(samples.t)
    ray = np.stack([(spots[:, 0] - 0.5 * WIDTH) / FOCAL, (0.5 * HEIGHT - spots[:, 1]) / FOCAL, -np.ones(n)], axis=-1)
    in_head = rotations.rotate(mount_q, ray)
    in_stage = rotations.rotate(head_q, in_head)
    eye = head_p + rotations.rotate(head_q, mount.p)
    # What would lie beyond the horizon is put 4 m away, as furniture is.
    sinking = np.minimum(in_stage[:, 1], -1e-3)
    depth = np.minimum((height - eye[:, 1]) / sinking, 4.0)
    samples.p[where] = (np.asarray(mount.p) + depth[:, None] * in_head)[where]
    deviation = depth**2 * _SUBPIXEL / (FOCAL * BASELINE * math.sqrt(_DEPTH_SAMPLES))
    local_cov = _covariance(ray, 0.2 * depth / FOCAL, deviation)
    samples.cov[where] = _turned(local_cov, mount_q)[where]
    if samples.q is not None and samples.q_alt is not None:
        samples.q[where], samples.q_alt[where] = turn[where], other_turn[where]
    if samples.size_ratio is not None:
        samples.size_ratio[where] = ratio[where]
    border = np.minimum(np.minimum(spots[:, 0], WIDTH - spots[:, 0]), np.minimum(spots[:, 1], HEIGHT - spots[:, 1]))
    samples.edge_px[where] = np.maximum(border - 12.0, 0.0)[where]
    samples.found[where] = True
    samples.false[where] = True


def lay_flat(samples: OpticalSamples, where: Flags, truth: Truth, random: np.random.Generator) -> None:
    """Let false finds be a tag of the right size that lies on the floor and always looks the same."""
    n = len(samples.t)
    flat = rotations.multiply(rotations.from_yaw(random.uniform(-math.pi, math.pi)), _FACE_UP)
    noise_q = rotations.from_rotation_vector(_LYING_SD * random.standard_normal((n, 3)))
    seen = rotations.multiply(rotations.conjugate(truth.head.pose(samples.t)[1]), rotations.multiply(flat, noise_q))
    ratio = 1.0 + _LYING_SD * random.standard_normal(n)
    if samples.q is not None:
        samples.q[where] = seen[where]
    if samples.size_ratio is not None:
        samples.size_ratio[where] = ratio[where]


def blobs(
    truth: Truth, side: Side, settings: Settings, run: Pictures, faults: Sequence[Fault], random: np.random.Generator
) -> OpticalSamples:
    """What the depth tracker finds of one foot. The infrared shutter is global: blur does not hurt it."""
    mount = settings.camera.mount
    n = len(run.middle)
    t = run.middle
    eye = camera.eye(truth, t, mount, faults)
    middle = _BLOB + _BLOB_SD * random.standard_normal(3)
    middle = middle + noise.gauss_markov(random, n, 1.0 / FPS, _BLOB_TAU_S, _BLOB_WANDER)
    foot_p, foot_q = truth.feet[side].pose(t)
    points = foot_p + rotations.rotate(foot_q, middle)
    # The leg above hides the ankle from nearly everywhere: the blob is there while the front of the shoe is.
    tips = foot_p + rotations.rotate(foot_q, settings.feet.of(side).toe.p)
    pixels, depth = camera.project(eye, points)
    u, v = pixels[:, 0], pixels[:, 1]
    edge = np.minimum(np.minimum(u, WIDTH - u), np.minimum(v, HEIGHT - v)) - _BLOB_RADIUS_PX
    found = (depth > 0.3) & (edge > 0.0) & ~camera.hidden(truth, tips, eye, settings)
    found &= random.random(n) >= _BLOB_MISS
    depth = np.maximum(depth, 0.05)
    # "Depth at the blob's nearest valid pixel": one pixel, not the median of many.
    depth_sd = depth**2 * _SUBPIXEL / (FOCAL * BASELINE)
    local = rotations.unrotate(eye.q, points - eye.p)
    measured, cov = _measured(local, np.full(n, _BLOB_PX), depth_sd, run, random)
    mount_q = rotations.normalised(mount.q)
    return OpticalSamples(
        t + _STAMP_JITTER_SD * random.standard_normal(n),
        run.t_pub,
        np.asarray(mount.p) + rotations.rotate(mount_q, measured),
        None,
        None,
        _turned(cov, mount_q),
        None,
        None,
        edge,
        np.arange(n, dtype=np.int64),
        found,
        np.zeros(n, dtype=np.bool_),
    )


def _found(view: TagView, cells: int, random: np.random.Generator) -> Flags:
    """Whether the detector reads the tag: large enough, not too blurred, in sight; (n,)."""
    cell_px = np.maximum(view.size_px, 1e-3) / cells
    blurred = np.clip((view.blur_px / cell_px - _FOUND_AT_CELLS) / _FOUND_WIDTH, -40.0, 40.0)
    small = np.clip((_CELL_PX - cell_px) / _CELL_WIDTH, -40.0, 40.0)
    chance = (1.0 - _MISS_SHARE) / ((1.0 + np.exp(blurred)) * (1.0 + np.exp(small)))
    found: Flags = view.inside & (view.edge_px >= _BORDER_PX) & ~view.hidden & (random.random(len(chance)) < chance)
    return found


def _measured(
    local: Array, lateral_px: Array, depth_sd: Array, run: Pictures, random: np.random.Generator
) -> tuple[Array, Array]:
    """Points (n, 3), camera frame, as the camera has them, and the covariance (n, 6) of their noise alone."""
    n = len(local)
    depth = np.maximum(-local[:, 2], 0.05)
    ray = local / depth[:, None]
    radius = ray[:, :2] * FOCAL / (0.5 * WIDTH)
    squared = np.sum(radius**2, axis=-1, keepdims=True)
    wrong_px = squared * (radius @ run.lens)
    off = lateral_px[:, None] * random.standard_normal((n, 2)) + wrong_px
    seen = ray + np.concatenate([off / FOCAL, np.zeros((n, 1))], axis=-1)
    seen_depth = depth * run.depth_scale + depth_sd * random.standard_normal(n)
    return seen * seen_depth[:, None], _covariance(ray, lateral_px * depth / FOCAL, depth_sd)


def _covariance(ray: Array, lateral_sd: Array, depth_sd: Array) -> Array:
    """(n, 3, 3): noise across the picture, and of the depth along the ray (n, 3) of unit depth."""
    along = depth_sd[:, None] * ray
    cov = along[:, :, None] * along[:, None, :]
    cov[:, 0, 0] += lateral_sd**2
    cov[:, 1, 1] += lateral_sd**2
    return np.asarray(cov)


def _turned(cov: Array, q: Array) -> Array:
    """(n, 3, 3) in another frame, as the wire has it: (n, 6)."""
    matrix = rotations.to_matrix(q)
    turned = matrix @ cov @ matrix.T
    return np.asarray(turned[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]])


def _attitudes(
    q: Array, local: Array, corner_share: Array, facing: Array, random: np.random.Generator
) -> tuple[Array, Array]:
    """The tag's attitude with noise, and the planar pose's other solution: the normal mirrored on the line of sight.

    `corner_share` is corner noise over the tag's size. A square tells its turn in the picture well and its tilt the
    worse the more it faces the camera.
    """
    n = len(q)
    slant = np.sqrt(np.maximum(1.0 - facing**2, 0.0))
    tilt_sd = np.minimum(3.0 * corner_share / np.maximum(slant, 0.25), math.radians(12.0))
    sd = np.stack([tilt_sd, tilt_sd, corner_share / math.sqrt(2.0)], axis=-1)
    q = rotations.multiply(q, rotations.from_rotation_vector(sd * random.standard_normal((n, 3))))
    sight = -local / np.linalg.norm(local, axis=-1, keepdims=True)
    normal = rotations.rotate(q, [0.0, 0.0, 1.0])
    # Mirroring n on s turns it about n x s by twice the angle between them.
    axis = np.cross(normal, sight)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, np.sum(normal * sight, axis=-1, keepdims=True))
    other = rotations.from_rotation_vector(axis / np.maximum(sine, 1e-9) * angle)
    return q, rotations.multiply(other, q)
