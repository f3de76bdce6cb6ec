"""The humanoid that walks: 22 joints with VRM 1.0's bone names, in the *model* frame.

The model frame is glTF's and VRM's: right-handed, metres, +Y up, the body faces +Z, so its left is +X.
The rest pose is VRM's T-pose with every joint's axes along the model's. Turning to the wire's frame, which
faces -Z, happens in `foottrack_service.walkcycle.wire` and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot

Array = npt.NDArray[np.float64]

_TREE: Final = (
    # joint, parent, offset in the parent's frame at 1.75 m (left side; the right is its mirror image)
    ("hips", None, (0.0, 0.95, 0.0)),
    ("spine", "hips", (0.0, 0.10, 0.0)),
    ("chest", "spine", (0.0, 0.12, 0.0)),
    ("upperChest", "chest", (0.0, 0.13, 0.0)),
    ("neck", "upperChest", (0.0, 0.14, 0.0)),
    ("head", "neck", (0.0, 0.09, 0.0)),
    ("leftShoulder", "upperChest", (0.03, 0.09, 0.0)),
    ("leftUpperArm", "leftShoulder", (0.14, 0.0, 0.0)),
    ("leftLowerArm", "leftUpperArm", (0.27, 0.0, 0.0)),
    ("leftHand", "leftLowerArm", (0.25, 0.0, 0.0)),
    ("rightShoulder", "upperChest", (-0.03, 0.09, 0.0)),
    ("rightUpperArm", "rightShoulder", (-0.14, 0.0, 0.0)),
    ("rightLowerArm", "rightUpperArm", (-0.27, 0.0, 0.0)),
    ("rightHand", "rightLowerArm", (-0.25, 0.0, 0.0)),
    ("leftUpperLeg", "hips", (0.09, 0.0, 0.0)),
    ("leftLowerLeg", "leftUpperLeg", (0.0, -0.43, 0.0)),
    ("leftFoot", "leftLowerLeg", (0.0, -0.43, 0.0)),
    ("leftToes", "leftFoot", (0.0, -0.065, 0.13)),
    ("rightUpperLeg", "hips", (-0.09, 0.0, 0.0)),
    ("rightLowerLeg", "rightUpperLeg", (0.0, -0.43, 0.0)),
    ("rightFoot", "rightLowerLeg", (0.0, -0.43, 0.0)),
    ("rightToes", "rightFoot", (0.0, -0.065, 0.13)),
)

JOINTS: Final = tuple(name for name, _, _ in _TREE)
INDEX: Final = {name: i for i, name in enumerate(JOINTS)}
PARENTS: Final = tuple(-1 if parent is None else INDEX[parent] for _, parent, _ in _TREE)
SIDES: Final = ("left", "right")
LEG_JOINTS: Final = frozenset(s + part for s in SIDES for part in ("UpperLeg", "LowerLeg", "Foot", "Toes"))
POSED_JOINTS: Final = tuple(name for name in JOINTS if name not in LEG_JOINTS)
"""Joints whose rotation a pose gives; the legs follow from the feet."""

REST_HEIGHT_M: Final = 1.75
_HEEL: Final = (0.0, -0.09, -0.05)
_TOE_TIP: Final = (0.0, -0.025, 0.07)
_EYES: Final = (0.0, 0.10, 0.09)


@dataclass(frozen=True)
class Measures:
    """Lengths of one person, m, that are known; None is in proportion to the height."""

    thigh: float | None = None
    shank: float | None = None
    hip_width: float | None = None
    """Between the hip joints."""
    torso: float | None = None
    """From the pelvis up to the head's joint."""
    ankle_height: float | None = None
    """Above the sole."""
    heel_behind: float | None = None
    """Of the ankle."""
    ball_ahead: float | None = None
    """The toes' joint ahead of the ankle."""


@dataclass(frozen=True)
class Humanoid:
    """One body: joint offsets at rest (22, 3) and the extra points, all in metres, of a given height.

    Extra points: `heel` in the foot's frame and `toe_tip` in the toes' (both on the floor when the body stands
    at rest), `eyes` in the head's, which is where the wire's head frame sits.
    """

    height: float = REST_HEIGHT_M
    measures: Measures = Measures()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.height) and 0.3 <= self.height <= 3.0):
            raise ValueError(f"a body's height must be 0.3 to 3 m, not {self.height}")

    @property
    def scale(self) -> float:
        """Ratio of this body's lengths to those of the body that presets are posed on."""
        return self.height / REST_HEIGHT_M

    @property
    def offsets(self) -> Array:
        return self._offsets.copy()

    @property
    def heel(self) -> Array:
        x, y, z = np.array(_HEEL) * self.scale
        known = self.measures
        height = -y if known.ankle_height is None else known.ankle_height
        return np.array([x, -height, z if known.heel_behind is None else -known.heel_behind])

    @property
    def toe_tip(self) -> Array:
        return np.array(_TOE_TIP) * self.scale

    @property
    def ball(self) -> Array:
        """The toes' joint in the foot's frame: what the foot rolls over."""
        return np.asarray(self._offsets[INDEX["leftToes"]])

    @property
    def eyes(self) -> Array:
        return np.array(_EYES) * self.scale

    @property
    def thigh(self) -> float:
        return float(-self._offsets[INDEX["leftLowerLeg"], 1])

    @property
    def shank(self) -> float:
        return float(-self._offsets[INDEX["leftFoot"], 1])

    @property
    def leg(self) -> float:
        """Thigh and shank, m."""
        return self.thigh + self.shank

    @property
    def ankle_height(self) -> float:
        return float(-self.heel[1])

    @property
    def ball_height(self) -> float:
        """Height of the toes' joint above the sole, m."""
        return float(-self.toe_tip[1])

    @cached_property
    def _offsets(self) -> Array:
        offsets = np.array([offset for _, _, offset in _TREE]) * self.scale
        known = self.measures
        for side, sign in (("left", 1.0), ("right", -1.0)):
            hip, knee, ankle, ball = (INDEX[side + part] for part in ("UpperLeg", "LowerLeg", "Foot", "Toes"))
            if known.hip_width is not None:
                offsets[hip, 0] = 0.5 * sign * known.hip_width
            if known.thigh is not None:
                offsets[knee, 1] = -known.thigh
            if known.shank is not None:
                offsets[ankle, 1] = -known.shank
            offsets[ball, 1] = self.ball_height + self.heel[1]
            if known.ball_ahead is not None:
                offsets[ball, 2] = known.ball_ahead
        offsets[0, 1] = -float(self.heel[1] + offsets[INDEX["leftLowerLeg"], 1] + offsets[INDEX["leftFoot"], 1])
        if known.torso is not None:
            trunk = [INDEX[name] for name in ("spine", "chest", "upperChest", "neck", "head")]
            offsets[trunk] *= known.torso / float(np.sum(offsets[trunk, 1]))
        return offsets


def forward_kinematics(offsets: Array, hips: Array, rotations: Array) -> tuple[Array, Array]:
    """World positions (n, 22, 3) and rotations (n, 22, 4) of all joints.

    `offsets` (22, 3) at rest, `hips` (n, 3) the root's world positions, `rotations` (n, 22, 4) each joint to its
    parent.
    """
    positions = np.empty((*rotations.shape[:-1], 3))
    world = np.empty_like(rotations)
    positions[:, 0], world[:, 0] = hips, rotations[:, 0]
    for joint, parent in enumerate(PARENTS[1:], start=1):
        world[:, joint] = rot.multiply(world[:, parent], rotations[:, joint])
        positions[:, joint] = positions[:, parent] + rot.rotate(world[:, parent], offsets[joint])
    return positions, world


def mirrored_name(name: str) -> str:
    """The same bone on the other side; bones of the middle are their own."""
    if name.startswith("left"):
        return "right" + name[4:]
    if name.startswith("right"):
        return "left" + name[5:]
    return name
