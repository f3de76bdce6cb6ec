"""The body of one person through time: hips, hip joints and knees from the head and the feet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from foottrack_protocol.messages import Side
from foottrack_service.body import posture
from foottrack_service.body.facing import PelvisFacing, foot_yaw, head_yaw
from foottrack_service.body.legs import knee, knee_axis
from foottrack_service.body.posture import Facing
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.body.vectors import Quaternion, Vec
from foottrack_service.body.whole_body import WholeBody

Solver = Literal["two-bone", "fabrik"]


class FootPlace(NamedTuple):
    """One ankle [m] and the foot's rotation to the stage."""

    p: Vec
    q: Quaternion


class Legs(NamedTuple):
    """Hips (centre m, rotation to the stage), and hip joint and knee [m] of each foot that there is."""

    hips: Vec
    hips_q: Quaternion
    joints: dict[Side, Vec]
    knees: dict[Side, Vec]


class BodySolver:
    """Follows one person. ``skeleton`` may be exchanged at any time.

    "two-bone" puts the hips where trunk and legs say; "fabrik" bends a spine of fixed length besides, within joint
    limits. In both, thighs and shanks keep their lengths wherever the feet are within reach of each other.
    """

    def __init__(self, skeleton: Skeleton, solver: Solver = "two-bone") -> None:
        self._facing = PelvisFacing()
        self.yaw = 0.0
        """What ``face`` found last."""
        self._solver = solver
        self.skeleton = skeleton

    @property
    def skeleton(self) -> Skeleton:
        """The person's measures."""
        return self._skeleton

    @skeleton.setter
    def skeleton(self, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._trees: dict[tuple[Side, ...], WholeBody] = {}

    def reset(self) -> None:
        """The stage moved: what was known of the facing does not hold."""
        self._facing.reset()

    def face(self, t: int, head_q: Sequence[float] | None, feet: Mapping[Side, FootPlace]) -> float:
        """Where the pelvis faces at ``t`` (ns, rising), rad, 0 towards -Z, positive to the left.

        From a head (q head to stage) and feet, as far as they are known. ``solve`` asks it itself.
        """
        head = None if head_q is None else head_yaw(head_q)
        self.yaw = self._facing.update(t, head, [foot_yaw(foot.q) for foot in feet.values()])
        return self.yaw

    def solve(self, t: int, head_p: Sequence[float], head_q: Sequence[float], feet: Mapping[Side, FootPlace]) -> Legs:
        """The body at ``t`` (ns, rising) of a head (m, stage; q head to stage) over these feet."""
        body = self._skeleton
        facing = Facing.of(self.face(t, head_q, feet))
        ankles = {side: foot.p for side, foot in feet.items()}
        axes = {side: knee_axis(facing.right, facing.forward, foot.q) for side, foot in feet.items()}
        top = posture.neck(head_p, head_q, body)
        centre, pitch = posture.hips_below(top, facing, ankles, body)
        hips = posture.place(centre, pitch, facing, ankles, body)
        if self._solver == "fabrik" and feet:
            x, y, z = head_p
            centre = self._tree(tuple(feet)).solve((x, y, z), top, hips.p, facing, ankles, axes)
            # Where trunk and legs cannot both have their lengths, the legs have them.
            hips = posture.place(centre, pitch, facing, ankles, body)
        knees = {side: knee(hips.joints[side], ankles[side], axes[side], facing.forward, body) for side in ankles}
        return Legs(hips.p, hips.q, hips.joints, knees)

    def _tree(self, sides: tuple[Side, ...]) -> WholeBody:
        if sides not in self._trees:
            self._trees[sides] = WholeBody(self._skeleton, sides)
        return self._trees[sides]
