"""Follows the tags from picture to picture: windows where they should be, the whole picture only when one is lost."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from foottrack_service.camera.detector import Detection, TagDetector, Window
from foottrack_service.camera.fix import Fix, edge_distance
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.pose import CORNER_SIGMA_PX, solve_target
from foottrack_service.camera.pose_kernel import fit_both
from foottrack_service.camera.ranging import DEPTH_NOISE, join_depth
from foottrack_service.camera.rig import D435_COLOUR, Rig
from foottrack_service.camera.targets import Tag, Target, owners
from foottrack_service.compiled import is_compiled
from foottrack_service.rotations import Array

LOST_AFTER_S = 0.1
"""How long a tag is expected where it was heading before the whole picture is searched."""
SEARCH_PERIOD_S = 0.05
"""A whole picture costs ten windows: while a tag is lost, one is searched so often."""

_log = logging.getLogger(__name__)
_SPEED_M_S = 5.0
_ACCELERATION_M_S2 = 150.0
"""What foot and head together may do between two pictures; it widens the windows."""
_MARGIN_PX = 6.0
_BLUR_NOISE = 0.14
"""Corner noise per px of motion blur (measured on rendered pictures: 0.5 px at 4 px of blur, 1.2 at 8)."""


@dataclass
class _Track:
    """What is known of one target: OpenCV's camera frame, m, m/s; `t` ns; no velocity after one sighting."""

    t: int
    p: tuple[float, float, float]
    v: tuple[float, float, float] | None


class MarkerTracker:
    """One per camera. Feed it every picture, in order."""

    def __init__(self, rig: Rig, dictionary: Any, targets: Sequence[Target], depth_noise: float = DEPTH_NOISE) -> None:
        self._rig, self._targets, self._noise = rig, tuple(targets), depth_noise
        self._detector = TagDetector(dictionary, owners(targets))
        self._tracks: dict[str, _Track] = {}
        self._searched: int | None = None
        self.windows: dict[str, Window] = {}
        """Where the last picture was looked at, per side; a side that is missing was searched for everywhere."""

    def process(self, frame: Frame) -> list[Fix]:
        """The targets found in a picture."""
        self.windows = {}
        fixes: list[Fix] = []
        lost = []
        for target in self._targets:
            window = self._window(target, frame)
            if window is None:
                lost.append(target)
                continue
            self.windows[target.side] = window
            fixes += self._resolve(target, self._detector.look(frame.gray, window), frame)
        if lost and self._search_is_due(frame.t):
            self._searched = frame.t
            everywhere = self._detector.search(frame.gray)
            for target in lost:
                fixes += self._resolve(target, everywhere, frame)
        return fixes

    def _search_is_due(self, t: int) -> bool:
        return self._searched is None or not 0 <= t - self._searched < SEARCH_PERIOD_S * 1e9

    def _window(self, target: Target, frame: Frame) -> Window | None:
        track = self._tracks.get(target.side)
        if track is None:
            return None
        dt = (frame.t - track.t) * 1e-9
        if not 0.0 < dt <= LOST_AFTER_S:
            return None
        x, y, z = track.p
        if track.v is not None:
            vx, vy, vz = track.v
            x, y, z = x + vx * dt, y + vy * dt, z + vz * dt
        if z < 0.1:
            return None
        drift = 0.5 * _ACCELERATION_M_S2 * dt * dt if track.v is not None else _SPEED_M_S * dt
        px_per_m = self._rig.intrinsics.focal / z
        half = _MARGIN_PX + (1.15 * target.radius + min(drift, _SPEED_M_S * dt)) * px_per_m
        u, v = self._rig.intrinsics.project_one(x, y, z)
        height, width = frame.gray.shape
        left, top = int(max(0.0, u - half)), int(max(0.0, v - half))
        right, bottom = int(min(width, u + half + 1.0)), int(min(height, v + half + 1.0))
        if right <= left or bottom <= top:
            return None
        return Window(left, top, right, bottom, target.smallest * px_per_m)

    def _resolve(self, target: Target, detections: Sequence[Detection], frame: Frame) -> list[Fix]:
        seen = [d for d in detections if d.id in target.corners]
        if not seen:
            return []
        blur = self._blur_px(target, frame)
        sigma = math.hypot(CORNER_SIGMA_PX, _BLUR_NOISE * blur)
        pose = solve_target(target, seen, self._rig.intrinsics, sigma)
        if pose is None:
            return []
        p, cov, ratio = join_depth(pose, target, seen, frame, self._noise)
        outline = seen[0].corners if len(seen) == 1 else np.concatenate([d.corners for d in seen])
        t = frame.row_time(sum(outline[:, 1].tolist()) / len(outline))
        self._follow(target, t, p)
        height, width = frame.gray.shape
        rig = self._rig
        return [
            Fix(
                side=target.side,
                kind="marker",
                t=t,
                frame=frame.number,
                p=rig.to_head(p),
                q=rig.rotation_to_head(pose.q),
                q_alt=None if pose.q_alt is None else rig.rotation_to_head(pose.q_alt),
                cov=rig.covariance_to_head(cov),
                size_ratio=ratio,
                reproj_px=pose.reproj_px,
                edge_px=edge_distance(outline, width, height),
                outline=outline,
                label=f"{target.side} {'+'.join(str(d.id) for d in seen)} {float(p[2]):.2f} m",
            )
        ]

    def _blur_px(self, target: Target, frame: Frame) -> float:
        track = self._tracks.get(target.side)
        if track is None or track.v is None:
            return 0.0
        (x, y, z), (vx, vy, vz) = track.p, track.v
        across = math.hypot(vx - vz * x / z, vy - vz * y / z)
        return float(across * frame.exposure * self._rig.intrinsics.focal / z)

    def _follow(self, target: Target, t: int, p: Array) -> None:
        x, y, z = p.tolist()
        before = self._tracks.get(target.side)
        v = None
        if before is not None and 0 < t - before.t <= LOST_AFTER_S * 1e9:
            dt, (x0, y0, z0) = (t - before.t) * 1e-9, before.p
            v = (x - x0) / dt, (y - y0) / dt, (z - z0) / dt
        self._tracks[target.side] = _Track(t, (x, y, z), v)


def say_what_takes_long() -> None:
    """Tell that ``warm_up`` will compile: it may run in a process of its own, whose log nobody reads."""
    if not is_compiled(fit_both):
        _log.info("compiling the tag tracker for this machine: about ten seconds, this once")


def warm_up() -> None:
    """Compile what the first tag in view would wait for, or read it from the cache."""
    target = Target("left", (Tag(0, 0.06),))
    corners = D435_COLOUR.project(target.corners[0] * (1.0, -1.0, -1.0) + (0.0, 0.0, 1.0))
    seen = [Detection(0, corners)]
    pose = solve_target(target, seen, D435_COLOUR)
    assert pose is not None
    shape = D435_COLOUR.height, D435_COLOUR.width
    frame = Frame(np.zeros(shape, np.uint8), np.full(shape, 1000, np.uint16), 0, 0)
    p, cov, _ = join_depth(pose, target, seen, frame, DEPTH_NOISE)
    rig = Rig(D435_COLOUR)
    rig.to_head(p), rig.covariance_to_head(cov)
