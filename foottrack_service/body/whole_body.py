"""Head, spine, hips and legs as one tree, solved by FABRIK with joint limits and both ankles as end effectors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from foottrack_protocol.messages import Side
from foottrack_service.body.fabrik import Fabrik, Joint
from foottrack_service.body.legs import knee
from foottrack_service.body.limits import Cone, Hinge, Limit, Rigid
from foottrack_service.body.posture import REACH, Facing
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.body.vectors import Vec, along, cross, norm, sub, unit

_HEAD, _NECK, _CHEST, _HIPS = range(4)
_DOWN: Vec = (0.0, -1.0, 0.0)

# Front, back, right, left, rad: active ranges of motion (American Academy of Orthopaedic Surgeons, 1965), the spine's
# shared by its two bones. Spine bones point down from the neck, so a trunk that leans forward points backwards.
_TRUNK = (math.radians(30.0), math.radians(100.0), math.radians(35.0), math.radians(35.0))
_LUMBAR = (math.radians(45.0), math.radians(45.0), math.radians(25.0), math.radians(25.0))
_HIP_FRONT, _HIP_BACK, _HIP_OUT, _HIP_IN = (math.radians(angle) for angle in (125.0, 40.0, 60.0, 40.0))
_KNEE = math.radians(150.0)
_TOLERANCE = 1e-3
"""m: the legs are closed exactly afterwards."""
_ITERATIONS = 12


class WholeBody:
    """The tree of a person with these sides' feet. The head is its root: nothing is known better."""

    def __init__(self, body: Skeleton, sides: Sequence[Side]) -> None:
        rise, ahead = body.torso - body.neck_down, body.hip_back - body.neck_back
        bone = 0.5 * math.hypot(rise, ahead)
        joints = [
            Joint(None),
            Joint(_HEAD, math.hypot(body.neck_down, body.neck_back)),
            Joint(_NECK, bone),
            Joint(_CHEST, bone),
        ]
        self._legs: dict[Side, int] = {}
        for side in sides:
            first = self._legs[side] = len(joints)
            # Stretched, these legs are as long as a leg may be used.
            thigh, shank = REACH * body.thigh, REACH * body.shank
            joints += [Joint(_HIPS, 0.5 * body.hip_width), Joint(first, thigh), Joint(first + 1, shank)]
        self._body = body
        self._trunk = 2.0 * bone
        self._tree = Fabrik(joints)

    def solve(
        self, head: Vec, top: Vec, hips: Vec, facing: Facing, ankles: Mapping[Side, Vec], axes: Mapping[Side, Vec]
    ) -> Vec:
        """Hips' centre, m, from head, neck and ankles, beginning with ``hips`` as legs would have them.

        ``axes``: about which each knee bends (unit, to the right).
        """
        hips = along(top, unit(sub(hips, top), _DOWN), self._trunk)
        points = [head, top, _between(top, hips), hips]
        back: Vec = (-facing.forward[0], 0.0, -facing.forward[2])
        # A bone that points down has its front where the body has it.
        limits: dict[int, Limit] = {
            _NECK: Rigid(unit(sub(top, head), _DOWN)),
            _CHEST: Cone(facing.forward, facing.right, _TRUNK, _DOWN),
            _HIPS: Cone(facing.forward, facing.right, _LUMBAR),
        }
        targets: dict[int, Vec] = {}
        for side, first in self._legs.items():
            ankle, axis = ankles[side], axes[side]
            out = facing.right if side == "right" else (-facing.right[0], 0.0, -facing.right[2])
            joint = along(hips, out, 0.5 * self._body.hip_width)
            points += [joint, knee(joint, ankle, axis, facing.forward, self._body), ankle]
            sides = (_HIP_OUT, _HIP_IN) if side == "right" else (_HIP_IN, _HIP_OUT)
            limits[first] = Rigid(out)
            limits[first + 1] = Cone(facing.forward, facing.right, (_HIP_FRONT, _HIP_BACK, *sides), _DOWN)
            limits[first + 2] = Hinge(_across(axis, unit(sub(ankle, joint), _DOWN), back), _KNEE)
            targets[first + 2] = ankle
        found = self._tree.solve(points, targets, limits, tolerance=_TOLERANCE, most_iterations=_ITERATIONS)
        return found.points[_HIPS]


def _across(axis: Vec, leg: Vec, back: Vec) -> Vec:
    # The knee's axis as the leg has it: its plane then holds both hip and ankle.
    return unit(cross(leg, cross(axis, leg)), unit(cross(leg, back), axis))


def _between(a: Vec, b: Vec) -> Vec:
    # Not quite on the line: a chain that is straight and whose target lies on it cannot bend (FABRIK's one deadlock).
    middle = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))
    return along(middle, unit(cross(sub(b, a), (1.0, 0.0, 0.0)), (0.0, 0.0, 1.0)), 1e-3 * norm(sub(b, a)))
