"""S. H. Lee's own way of walking a cycle forward (2005), kept to be compared with.

Root compensation: in the first half of a step the root moves so that the front foot's *heel* stays where it is, in
the second so that its *ball* does. Only that one foot is held: in double support the other one slips. The printed
loop that repeats a step adds the growing offset to itself and so doubles it: 1, 2, 4, 8 steps instead of 1, 2, 3, 4.
On a curve each line segment has one heading, and no heading keys are set in the second half of a step and the first
half of the next one, so that the turn happens there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from foottrack_service.walkcycle.curves import periodic, periodic_rotation
from foottrack_service.walkcycle.measure import foot_points
from foottrack_service.walkcycle.project import Project, full_cycle
from foottrack_service.walkcycle.skeleton import POSED_JOINTS, SIDES, Humanoid
from foottrack_service.walkcycle.walk import FootTargets, Motion, Targets, close_legs

Array = npt.NDArray[np.float64]


def posed_motion(project: Project, phases: Array) -> Motion:
    """The key poses and the curves through them as they are, on the spot, at phases (n,): nothing is planted."""
    keys = sorted(full_cycle(project).keys, key=lambda key: key.phase)
    at = np.array([key.phase for key in keys])
    joints = {}
    for name in POSED_JOINTS:
        values = np.array([key.pose.rotations.get(name, (0.0, 0.0, 0.0, 1.0)) for key in keys])
        joints[name] = periodic_rotation(at, values)(phases)
    feet = {}
    for side in SIDES:
        poses = [key.pose.left if side == "left" else key.pose.right for key in keys]
        values = np.array([[*foot.ankle, foot.yaw, foot.pitch, foot.pitch + foot.toe] for foot in poses])
        track = periodic(at, values)(phases)
        feet[side] = FootTargets(track[:, :3], track[:, 3], track[:, 4], track[:, 5])
    hips = periodic(at, np.array([key.pose.hips for key in keys]))(phases)
    return close_legs(Humanoid(project.height), phases * project.period, Targets(phases, hips, joints, feet))


def compensated_step(project: Project, frames: int) -> Motion:
    """One step on a straight line, the left foot in front, (frames + 1) instants, moved forward by root compensation
    alone: the heel is held in its first half, the ball in its second."""
    motion = posed_motion(project, np.linspace(0.0, 0.5, frames + 1))
    foot = foot_points(Humanoid(project.height), motion)["left"]
    half = frames // 2
    moved = np.zeros(frames + 1)
    moved[: half + 1] = foot.heel[0, 2] - foot.heel[: half + 1, 2]
    moved[half:] = moved[half] + foot.ball[half, 2] - foot.ball[half:, 2]
    return replace(motion, hips=motion.hips + moved[:, None] * np.array([0.0, 0.0, 1.0]))


def step_offsets_as_printed(step: float, steps: int) -> Array:
    """Where each of `steps` repetitions begins when the loop is taken literally, (steps,) m: the offset doubles."""
    offsets, offset = [], step
    for _ in range(steps):
        offsets.append(offset)
        offset += offset
    return np.array(offsets)


def step_offsets_as_meant(step: float, steps: int) -> Array:
    """The same as it must be: one step more each time, (steps,) m."""
    return np.asarray(step * np.arange(1, steps + 1))


def heading_keys(points: npt.ArrayLike, frames: int) -> list[tuple[int, float]]:
    """Lee's curve rule: keys (frame, yaw rad) for a walk of one step per segment of `points` (k, 2), `frames` each.

    Where the heading changes from step n - 1 to step n, the keys between the middle of n - 1 and the middle of n are
    left out; the turn is what the animation system interpolates there.
    """
    edges = np.diff(np.asarray(points, dtype=np.float64), axis=0)
    yaws = [float(yaw) for yaw in np.unwrap(np.arctan2(edges[:, 0], edges[:, 1]))]
    middles = [(n * frames + frames // 2, yaw) for n, yaw in enumerate(yaws)]
    return [(0, yaws[0]), *middles, (len(yaws) * frames, yaws[-1])]


def interpolated_heading(keys: list[tuple[int, float]], frame: npt.ArrayLike) -> Array:
    """Yaw (n,) rad between heading keys, as an animation system interpolates them."""
    return np.asarray(np.interp(np.asarray(frame, dtype=np.float64), [f for f, _ in keys], [y for _, y in keys]))
