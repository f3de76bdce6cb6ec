"""Scenes and true values that the camera's tests share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from foottrack_service import rotations
from foottrack_service.camera.dictionaries import load_dictionary
from foottrack_service.camera.frame import Frame
from foottrack_service.camera.rendering.motion import PoseTrack, moving, still
from foottrack_service.camera.rendering.renderer import Renderer, Shutter
from foottrack_service.camera.rendering.scene import Scene, make_shoe
from foottrack_service.camera.rig import D435_COLOUR, Rig
from foottrack_service.camera.targets import Tag, Target
from foottrack_service.rotations import Array

MARKER_P = np.array([0.0, -0.04, -0.15])
MARKER_Q = (-0.70710678, 0.0, 0.0, 0.70710678)
RIG = Rig(D435_COLOUR)
SHUTTER = Shutter(0.003, 0.010)


def targets(size: float = 0.06) -> list[Target]:
    """One tag a shoe."""
    return [Target("left", (Tag(0, size),)), Target("right", (Tag(1, size),))]


@dataclass
class World:
    """A scene, its renderer, and where its targets truly are."""

    scene: Scene
    dictionary: Any
    targets: list[Target]
    renderer: Renderer

    def frame(self, number: int, fps: float = 60.0) -> Frame:
        """Picture `number`."""
        t = number / fps
        gray, depth = self.renderer.render(t)
        shutter = self.renderer.shutter
        return Frame(gray, depth, round(t * 1e9), number, shutter.exposure, shutter.readout)

    def truth(self, side: str, t_ns: int) -> tuple[Array, Array]:
        """Target in the head frame, p (3,) and q (4,), at a bus time."""
        t = np.array([t_ns * 1e-9])
        head_p, head_q = self.scene.head(t)
        p, q = self.scene.feet[side](t)
        tag = p + rotations.rotate(q, MARKER_P)
        inverse = rotations.conjugate(head_q)
        return (
            rotations.rotate(inverse, tag - head_p)[0],
            rotations.multiply(inverse, rotations.multiply(q, MARKER_Q))[0],
        )


def world(
    head: PoseTrack,
    feet: dict[str, PoseTrack],
    shoes: Sequence[Target] | None = None,
    dictionary: str = "DICT_4X4_50",
    shutter: Shutter = SHUTTER,
    **options: Any,
) -> World:
    """A world with a D435-like camera."""
    made = list(shoes) if shoes is not None else targets()
    known = load_dictionary(dictionary)
    scene = Scene(head, feet, {target.side: make_shoe(target, known, MARKER_P, MARKER_Q) for target in made})
    return World(scene, known, made, Renderer(scene, RIG, shutter, **options))


def stepping(x: float, phase: float, length: float = 0.35, period: float = 1.2) -> PoseTrack:
    """A foot that steps forward and back: it stands for half of each period."""

    def track(t: Array) -> tuple[Array, Array]:
        cycles = np.asarray(t) / period + phase
        swing = np.clip((cycles % 1.0 - 0.5) / 0.5, 0.0, 1.0)
        smooth = swing**3 * (10.0 - 15.0 * swing + 6.0 * swing**2)
        start = np.where(np.floor(cycles) % 2 == 0, 0.0, -length)
        z = start + (-length - 2.0 * start) * smooth
        lift = np.sin(np.pi * swing) ** 2
        p = np.stack([np.full_like(z, x), 0.09 + 0.12 * lift, z - 0.05], axis=-1)
        return p, rotations.from_axis_angle([1.0, 0.0, 0.0], -0.4 * lift)

    return track


def looking_down(sway: float = 0.1) -> PoseTrack:
    """A head 1.6 m up that looks at its feet, and moves."""

    def track(t: Array) -> tuple[Array, Array]:
        t = np.asarray(t)
        p = np.stack([0.03 * np.sin(5.2 * t), 1.6 + 0.02 * np.sin(10.4 * t), 0.05 * np.sin(3.0 * t)], axis=-1)
        pitch = rotations.from_axis_angle([1.0, 0.0, 0.0], np.radians(-50.0) + sway * np.sin(4.8 * t))
        return p, rotations.multiply(rotations.from_yaw(sway * np.sin(3.7 * t)), pitch)

    return track


def passing(size: float, distance: float, blur_px: float, dictionary: str, seed: int) -> tuple[World, Array]:
    """A tag that passes the picture's middle at t = 0 so fast that it blurs by `blur_px`, and its corners (4, 2) px."""
    source = np.random.default_rng(seed)
    tilt, yaw, course = source.uniform(0.0, 0.35), source.uniform(-0.5, 0.5), source.uniform(0.0, 2.0 * np.pi)
    camera_q = rotations.from_axis_angle([1.0, 0.0, 0.0], -0.5 * np.pi + tilt)
    head_q = rotations.multiply(camera_q, rotations.conjugate(rotations.normalised(RIG.mount_q)))
    foot_q = rotations.from_yaw(yaw)
    foot_p = np.array([0.0, 0.09, 0.0])
    tag = foot_p + rotations.rotate(foot_q, MARKER_P)
    camera_p = tag - distance * rotations.rotate(camera_q, [0.0, 0.0, -1.0]) + source.uniform(-0.003, 0.003, 3)
    head_p = camera_p - rotations.rotate(head_q, RIG.mount_p)
    speed = blur_px / SHUTTER.exposure * distance / RIG.intrinsics.fx
    v = speed * rotations.rotate(camera_q, [np.cos(course), np.sin(course), 0.0])
    foot = moving(tuple(foot_p), tuple(v), tuple(foot_q))
    target = Target("left", (Tag(0, size),))
    made = world(still(tuple(head_p), tuple(head_q)), {"left": foot}, [target], dictionary, depth=None)
    corners = rotations.rotate(np.array(MARKER_Q), target.corners[0]) + MARKER_P
    return made, made.renderer.project(corners, "left", 0.0)[0]
