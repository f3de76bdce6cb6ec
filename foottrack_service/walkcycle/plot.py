"""Pictures of a walk: the five poses, arcs, footprints from above, joint angles with the normative band."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from foottrack_service.walkcycle.cycle import Cycle
from foottrack_service.walkcycle.inplace import arc, in_place
from foottrack_service.walkcycle.measure import foot_points, joint_angles
from foottrack_service.walkcycle.normative import ANGLES, normative_mean, normative_sd
from foottrack_service.walkcycle.skeleton import INDEX, PARENTS, SIDES, forward_kinematics
from foottrack_service.walkcycle.walk import Motion, Walk

Array = npt.NDArray[np.float64]

COLOURS = {"left": "#c0392b", "right": "#2471a3", "middle": "#444444"}
POSES = ((0.0, "contact"), (0.125, "down"), (0.25, "pass"), (0.375, "up"), (0.5, "contact"))


def plot_all(cycle: Cycle, walk: Walk, folder: FilePath) -> list[FilePath]:
    """Write poses.png, arcs.png, footprints.png and angles.png into a folder and name them."""
    figures = {
        "poses": plot_poses(cycle),
        "arcs": plot_arcs(cycle),
        "footprints": plot_footprints(walk),
        "angles": plot_angles(cycle),
    }
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, figure in figures.items():
        file = folder / f"{name}.png"
        figure.savefig(file, dpi=110)
        files.append(file)
    return files


def plot_poses(cycle: Cycle) -> Figure:
    """The five poses side by side, from the left side and from the front."""
    figure = Figure(figsize=(13, 7.2), layout="constrained")
    motion = in_place(cycle, [phase for phase, _ in POSES])
    for row, (axis, view) in enumerate(((2, "from the side"), (0, "from the front"))):
        axes = figure.add_subplot(2, 1, row + 1)
        for i, (phase, name) in enumerate(POSES):
            _stick(axes, cycle, motion, i, axis, shift=1.25 * cycle.body.scale * i)
            axes.text(
                1.25 * cycle.body.scale * i, -0.14, f"{name}\n{100 * phase:.1f} %", ha="center", va="top", fontsize=9
            )
        axes.axhline(0.0, color="#999999", lw=0.8)
        axes.set(aspect="equal", xticks=[], ylabel="m", title=f"{cycle.project.name}, {view}")
        axes.set_ylim(-0.42 * cycle.body.scale, 1.9 * cycle.body.scale)
    return figure


def plot_arcs(cycle: Cycle) -> Figure:
    """Arcs of wrist, heel, toes and head in the root frame with the marks of the keys."""
    figure = Figure(figsize=(13, 4.6), layout="constrained")
    views = (("from the side", 2, 1), ("from above", 2, 0), ("from the front", 0, 1))
    for i, (title, h, v) in enumerate(views, start=1):
        axes = figure.add_subplot(1, 3, i)
        for joint, colour in (
            ("leftHand", "#c0392b"),
            ("leftHeel", "#1e8449"),
            ("leftToeTip", "#2471a3"),
            ("head", "#444444"),
        ):
            path = arc(cycle, joint)
            closed = np.concatenate([path.points, path.points[:1]])
            axes.plot(closed[:, h], closed[:, v], color=colour, lw=1.2, label=joint)
            axes.plot(path.marks[:, h], path.marks[:, v], "o", color=colour, ms=3)
        axes.set(
            aspect="equal" if v == 1 else "auto",
            title=f"arcs {title}",
            xlabel="xyz"[h] + ", m",
            ylabel="xyz"[v] + ", m",
        )
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    return figure


def plot_footprints(walk: Walk) -> Figure:
    """Footprints on the path from above, with the pelvis' way."""
    figure = Figure(figsize=(8, 8), layout="constrained")
    axes = figure.add_subplot()
    s = np.linspace(0.0, walk.path.length, 400)
    place = walk.path.place(s)
    axes.plot(place[:, 0], place[:, 1], "--", color="#aaaaaa", lw=1.0, label="path")
    motion = walk.motion(walk.times(30.0))
    axes.plot(motion.hips[:, 0], motion.hips[:, 2], color=COLOURS["middle"], lw=1.0, label="pelvis")
    heel, tip, half = walk.body.heel[2], walk.body.ball[2] + walk.body.toe_tip[2], 0.045 * walk.body.scale
    sole = np.array(
        [
            [-0.6 * half, heel],
            [0.6 * half, heel],
            [half, 0.6 * tip],
            [0.5 * half, tip],
            [-0.5 * half, tip],
            [-half, 0.6 * tip],
        ]
    )
    for side in SIDES:
        for print_ in walk.plan.footprints[side]:
            c, sn = np.cos(print_.yaw), np.sin(print_.yaw)
            outline = sole @ np.array([[c, -sn], [sn, c]]) + np.array(print_.place)
            axes.fill(outline[:, 0], outline[:, 1], color=COLOURS[side], alpha=0.55, lw=0)
    for side, points in foot_points(walk.body, motion).items():
        axes.plot(points.ankle[:, 0], points.ankle[:, 2], color=COLOURS[side], lw=0.6, alpha=0.6, label=f"{side} ankle")
    # From above with +Z up the page, +X (the left) lies on the left.
    axes.invert_xaxis()
    axes.set(
        aspect="equal", xlabel="x (left), m", ylabel="z, m", title=f"{walk.cycle.project.name}, {walk.duration:.1f} s"
    )
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    return figure


def plot_angles(cycle: Cycle, samples: int = 101) -> Figure:
    """Sagittal angles of both legs over the cycle, with the published mean and one standard deviation."""
    figure = Figure(figsize=(12, 4), layout="constrained")
    phase = np.linspace(0.0, 1.0, samples)
    angles = {side: joint_angles(in_place(cycle, phase + (0.0 if side == "left" else 0.5)), side) for side in SIDES}
    for i, name in enumerate(ANGLES, start=1):
        axes = figure.add_subplot(1, 3, i)
        mean, sd = normative_mean(name, phase), normative_sd(name, phase)
        axes.fill_between(100 * phase, mean - sd, mean + sd, color="#cccccc", label="Schwartz 2008, 1 SD")
        for side in SIDES:
            axes.plot(
                100 * phase,
                angles[side][name],
                color=COLOURS[side],
                lw=1.3,
                ls="-" if side == "left" else ":",
                label=side,
            )
        axes.axvline(100 * cycle.project.contact.toe_off, color="#999999", lw=0.8)
        axes.set(title=f"{name}, degrees", xlabel="% of the cycle")
    axes.legend(fontsize=7)
    return figure


def _stick(axes: Any, cycle: Cycle, motion: Motion, index: int, axis: int, shift: float) -> None:
    positions, _ = forward_kinematics(cycle.body.offsets, motion.hips, motion.rotations)
    points = foot_points(cycle.body, motion)

    def draw(places: Array, colour: str, width: float) -> None:
        axes.plot(places[:, axis] + shift, places[:, 1], color=colour, lw=width, solid_capstyle="round")

    for name, joint in INDEX.items():
        if PARENTS[joint] >= 0:
            side = next((side for side in SIDES if name.startswith(side)), "middle")
            draw(positions[index, [PARENTS[joint], joint]], COLOURS[side], 3.0 if side == "middle" else 2.4)
    for side in SIDES:
        foot = points[side]
        outline = np.array([foot.ankle[index], foot.heel[index], foot.ball[index], foot.toe_tip[index]])
        draw(outline, COLOURS[side], 1.6)
    head = positions[index, INDEX["head"]]
    axes.plot(head[axis] + shift, head[1] + 0.1 * cycle.body.scale, "o", ms=15, mfc="none", color=COLOURS["middle"])
