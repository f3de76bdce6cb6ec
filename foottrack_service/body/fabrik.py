"""FABRIK: forward and backward reaching inverse kinematics.

A. Aristidou and J. Lasenby, FABRIK: a fast, iterative solver for the Inverse Kinematics problem, Graphical Models 73
(2011). Chains and trees of bones with several end effectors and joint limits; each point is found along a line, with
neither angles nor matrices.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from foottrack_service.body.limits import Limit
from foottrack_service.body.vectors import Vec, along, norm, sub, unit

_STALLED = 1e-3
"""An iteration that takes off less than this share of the error is one of a target out of reach."""
_ANYWHERE: Vec = (0.0, -1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Joint:
    """One point of a tree: the number of the point it hangs on (None for the root), and the bone between them, m."""

    parent: int | None
    length: float = 0.0


@dataclass(frozen=True, slots=True)
class Solution:
    """Points [m], iterations, and the largest distance of an end effector from its target, m."""

    points: list[Vec]
    iterations: int
    error: float


class Fabrik:
    """A tree of bones. A point follows the one that it hangs on; the first is the root, which stays where it is."""

    def __init__(self, joints: Sequence[Joint]) -> None:
        """Raises ValueError where the order is another."""
        if not joints or joints[0].parent is not None:
            raise ValueError("the first joint is the root and hangs on nothing")
        for index, joint in enumerate(joints[1:], start=1):
            if joint.parent is None or not 0 <= joint.parent < index or not joint.length > 0.0:
                raise ValueError(f"joint {index} hangs on a joint after it, or its bone has no length")
        self._bones = [(index, joint.parent or 0, joint.length) for index, joint in enumerate(joints)][1:]
        self._count = len(joints)
        self._plain = all(parent == index - 1 for index, parent, _ in self._bones)

    def solve(
        self,
        points: Sequence[Vec],
        targets: Mapping[int, Vec],
        limits: Mapping[int, Limit] | None = None,
        *,
        tolerance: float = 1e-4,
        most_iterations: int = 32,
    ) -> Solution:
        """Move ``points`` [m] (one per joint; the root's place, and where to begin) so that ``targets`` are met.

        ``targets`` are by the number of their joint, at least one, ``limits`` by that of the point at the bone's end.
        Bones have their lengths in every solution, and limits are kept. Ends when all targets are met within
        ``tolerance`` m, when it gets no nearer, or after ``most_iterations``.
        """
        limits = limits or {}
        moved = list(points)
        self._outward(moved, limits)
        error = _error(moved, targets)
        if self._plain and not limits and targets.keys() == {self._count - 1}:
            ((end, target),) = targets.items()
            if norm(sub(target, moved[0])) >= sum(length for _, _, length in self._bones):
                self._stretch(moved, target)
                return Solution(moved, 1, norm(sub(moved[end], target)))
        iterations = 0
        while error > tolerance and iterations < most_iterations:
            before = list(moved)
            self._inward(moved, targets, limits)
            self._outward(moved, limits)
            iterations += 1
            last, error = error, _error(moved, targets)
            if error > last * (1.0 - _STALLED):
                if error > last:
                    moved, error = before, last
                break
        return Solution(moved, iterations, error)

    def _inward(self, points: list[Vec], targets: Mapping[int, Vec], limits: Mapping[int, Limit]) -> None:
        # From the end effectors to the root. Where branches meet, each says where the point should be: the centroid.
        wishes: list[tuple[float, float, float, int]] = [(0.0, 0.0, 0.0, 0)] * self._count
        for index, parent, length in reversed(self._bones):
            x, y, z, count = wishes[index]
            here = targets.get(index)
            if here is None:
                if count == 0:
                    continue  # a branch without an end effector follows on the way out
                here = (x / count, y / count, z / count)
            points[index] = here
            bone = unit(sub(here, points[parent]), _ANYWHERE)
            limit = limits.get(index)
            wx, wy, wz = along(here, bone if limit is None else limit.alone(bone), -length)
            x, y, z, count = wishes[parent]
            wishes[parent] = (x + wx, y + wy, z + wz, count + 1)

    def _outward(self, points: list[Vec], limits: Mapping[int, Limit]) -> None:
        # From the root to the ends: here the bone before is known, so here the limits are applied.
        directions: list[Vec] = [_ANYWHERE] * self._count
        for index, parent, length in self._bones:
            direction = unit(sub(points[index], points[parent]), directions[parent])
            limit = limits.get(index)
            if limit is not None:
                direction = limit(directions[parent], direction)
            directions[index] = direction
            points[index] = along(points[parent], direction, length)

    def _stretch(self, points: list[Vec], target: Vec) -> None:
        direction = unit(sub(target, points[0]), _ANYWHERE)
        for index, parent, length in self._bones:
            points[index] = along(points[parent], direction, length)


def _error(points: Sequence[Vec], targets: Mapping[int, Vec]) -> float:
    return max(math.dist(points[index], target) for index, target in targets.items())
