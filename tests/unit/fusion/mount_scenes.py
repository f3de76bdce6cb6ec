"""What a calibrator of the mount is shown: a head that looks about over two standing feet, with a camera's errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.config import Placement
from foottrack_service.fusion.interface import HeadSample, OpticalFix
from foottrack_service.fusion.mount_kernel import EDGE
from foottrack_service.rotations import Array

DOWN = rot.from_rotation_vector([np.deg2rad(-80.0), 0.0, 0.0])
CAMERA = Placement(p=(0.0, 0.0, -0.08), q=tuple(DOWN.tolist()))
"""Looks straight down, but for 10 degrees."""
NONE = (rot.IDENTITY, np.zeros(3))


@dataclass(frozen=True)
class Look:
    """How the head moves, and what the devices are wrong by."""

    turning: float = 1.0
    """How far the head turns, of 14, 29 and 9 deg about x, y and z."""
    pixel: float = 0.001
    """m SD across."""
    depth: float = 0.003
    """m SD along."""
    head: float = 0.0
    """rad SD, of each head pose."""
    scale: float = 0.0
    lens: tuple[float, float] = (0.0, 0.0)
    """rad at the picture's edge, across and up, growing with the third power."""
    moving: bool = False
    """The feet, by 10 cm to either side."""


def seen(
    add: Callable[[Side, OpticalFix], None],
    frm: float,
    to: float,
    lack: tuple[Array, Array],
    look: Look = Look(),
    seed: int = 1,
) -> None:
    """Fixes of both feet at 30 pictures a second, times in s, through a mount that lacks (turn, shift)."""
    random = np.random.default_rng([round(frm * 10), seed])
    turn, shift = lack
    for t in np.arange(frm, to, 1 / 30):
        angles = look.turning * np.array([0.25 * np.sin(0.9 * t), 0.5 * np.sin(0.6 * t), 0.15 * np.sin(1.3 * t)])
        q = rot.from_rotation_vector(angles)
        p = np.array([0.1 * np.sin(0.5 * t), 1.6, 0.1 * np.cos(0.7 * t)])
        said = rot.multiply(q, rot.from_rotation_vector(look.head * random.normal(size=3)))
        head = HeadSample(round(t * 1e9), p, said)
        sides: tuple[tuple[Side, float], ...] = (("left", -0.12), ("right", 0.12))
        for side, x in sides:
            sway = 0.1 * np.sin(5.0 * t) if look.moving else 0.0
            true = rot.unrotate(q, np.array([x + sway, 0.05, -0.2]) - p)
            local = rot.unrotate(DOWN, rot.unrotate(turn, true - shift) - np.array(CAMERA.p))
            depth = -local[2]
            ray = local / depth
            edges = ray[:2] / EDGE
            ray[:2] += (edges @ edges) * edges * look.lens + look.pixel / depth * random.normal(size=2)
            local = ray * (depth * (1.0 + look.scale) + look.depth * random.normal())
            cov = rot.to_matrix(DOWN) @ np.diag([look.pixel**2, look.pixel**2, look.depth**2]) @ rot.to_matrix(DOWN).T
            at = np.array(CAMERA.p) + rot.rotate(DOWN, local)
            add(side, OpticalFix(head.t, "marker", at, None, None, cov, 1.0, 50.0, head, head))
