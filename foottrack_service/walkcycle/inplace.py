"""A cycle on the spot, as on a treadmill, and the arcs that its joints draw there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.cycle import Cycle
from foottrack_service.walkcycle.errors import ProjectError
from foottrack_service.walkcycle.path import line
from foottrack_service.walkcycle.project import full_cycle
from foottrack_service.walkcycle.skeleton import INDEX, Humanoid, forward_kinematics
from foottrack_service.walkcycle.walk import Motion, Targets, Walk, close_legs, walk_along

Array = npt.NDArray[np.float64]

EXTRA_POINTS = ("leftHeel", "rightHeel", "leftToeTip", "rightToeTip", "eyes")


@dataclass(frozen=True)
class Arc:
    """The path of one point over a cycle: `points` (n, 3) m closed by its first, `marks` (k, 3) where the keys are."""

    joint: str
    points: Array
    marks: Array
    names: tuple[str, ...]


def in_place_targets(cycle: Cycle, phases: npt.ArrayLike) -> Targets:
    """Targets at phases (n,) of the steady cycle in the root frame, which travels at the mean speed."""
    phases = np.asarray(phases, dtype=np.float64)
    walk = _steady(cycle)
    # The second cycle, so that the guide's ends are far away.
    targets = walk.targets((np.mod(phases, 1.0) + 2.0) * cycle.period)
    back = np.zeros((len(phases), 3))
    back[:, 2] = cycle.stride * (np.mod(phases, 1.0) + 2.0) - 0.5 * cycle.step + cycle.lead
    feet = {side: replace(foot, ankle=foot.ankle - back) for side, foot in targets.feet.items()}
    return replace(targets, hips=targets.hips - back, feet=feet)


def in_place(cycle: Cycle, phases: npt.ArrayLike) -> Motion:
    """Joint rotations of the same; times are phases times the period."""
    phases = np.asarray(phases, dtype=np.float64)
    return close_legs(cycle.body, phases * cycle.period, in_place_targets(cycle, phases))


def points_of(body: Humanoid, motion: Motion, name: str) -> Array:
    """World positions (n, 3) of a joint or an extra point. Raises ProjectError for another name."""
    positions, world = forward_kinematics(body.offsets, motion.hips, motion.rotations)
    if name in INDEX:
        return np.asarray(positions[:, INDEX[name]])
    bones = {"Heel": ("Foot", body.heel), "ToeTip": ("Toes", body.toe_tip)}
    if name == "eyes":
        return np.asarray(positions[:, INDEX["head"]] + rot.rotate(world[:, INDEX["head"]], body.eyes))
    for end, (bone, offset) in bones.items():
        if name in EXTRA_POINTS and name.endswith(end):
            joint = INDEX[name.removesuffix(end) + bone]
            return np.asarray(positions[:, joint] + rot.rotate(world[:, joint], offset))
    raise ProjectError(f"{name!r} is no joint; there are {', '.join([*INDEX, *EXTRA_POINTS])}")


def arc(cycle: Cycle, joint: str, samples: int = 200) -> Arc:
    """The arc of a joint relative to the pelvis' mean place, with the marks of the keys."""
    keys = sorted(full_cycle(cycle.project).keys, key=lambda key: key.phase)
    points = points_of(cycle.body, in_place(cycle, np.arange(samples) / samples), joint)
    marks = points_of(cycle.body, in_place(cycle, np.array([key.phase for key in keys])), joint)
    return Arc(joint, points, marks, tuple(key.name for key in keys))


def self_crossings(points: Array) -> int:
    """How often a closed polygon (n, 2) crosses itself; a figure of eight does once."""
    a, b = points, np.roll(points, -1, axis=0)
    n = len(points)
    i, j = np.triu_indices(n, 2)
    keep = ~((i == 0) & (j == n - 1))
    i, j = i[keep], j[keep]

    def side(p: Array, q: Array, r: Array) -> Array:
        return np.asarray((q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0]))

    one = side(a[i], b[i], a[j]) * side(a[i], b[i], b[j])
    two = side(a[j], b[j], a[i]) * side(a[j], b[j], b[i])
    return int(np.count_nonzero((one < 0.0) & (two < 0.0)))


def _steady(cycle: Cycle) -> Walk:
    return walk_along(cycle, line(12.0 * cycle.step), 12, start=False, stop=False)
