"""Words to pose presets with: an upper body that swings against the legs, and feet that roll."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.project import FootPose, Quaternion
from foottrack_service.walkcycle.rollover import planted_ankle
from foottrack_service.walkcycle.skeleton import Humanoid
from foottrack_service.walkcycle.standing import arm_rotations

Array = npt.NDArray[np.float64]

X_AXIS, Y_AXIS, Z_AXIS = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]


@dataclass(frozen=True)
class UpperBody:
    """Amplitudes in degrees, about a carriage. Pelvis and chest turn against each other once a cycle, the arms swing
    against the legs, the head looks ahead. `elbow_drag` opens and bends the elbow twice a cycle, a quarter of its wave
    off the swing, and `elbow_lead` (cycles) lets its own wave come before the shoulder's: either draws the wrist's arc
    out into a figure of eight."""

    pelvis_yaw: float = 4.4
    pelvis_list: float = 3.4
    chest_yaw: float = 4.0
    lean: float = 2.0
    arm: float = 20.0
    arm_forward: float = 4.0
    abduction: float = 0.0
    elbow: float = 18.0
    elbow_swing: float = 12.0
    elbow_drag: float = 10.0
    elbow_lead: float = 0.0

    def rotations(self, phase: float) -> dict[str, Quaternion]:
        """Joint rotations at a phase; 0 is the left foot's contact, when the left arm is behind."""
        wave = float(np.cos(2.0 * np.pi * phase))
        late = float(np.cos(2.0 * np.pi * (phase - 0.15)))
        bent = float(np.cos(2.0 * np.pi * (phase + self.elbow_lead)))
        drag = float(np.sin(4.0 * np.pi * phase))
        yaw, sway = -self.pelvis_yaw * wave, self.pelvis_list * late
        joints = {"hips": _turn(yaw, sway, 0.0)}
        spine_yaw = (self.chest_yaw * wave - yaw) / 3.0
        for name in ("spine", "chest", "upperChest"):
            joints[name] = _turn(spine_yaw, -sway / 3.0, self.lean / 3.0)
        for name in ("neck", "head"):
            joints[name] = _turn(-0.5 * self.chest_yaw * wave, 0.0, -0.5 * self.lean)
        for side, sign in (("left", -1.0), ("right", 1.0)):
            swing = self.arm_forward + self.lean + self.arm * sign * wave
            bend = self.elbow + self.elbow_swing * sign * bent - self.elbow_drag * drag
            joints[f"{side}Shoulder"] = _turn(0.15 * self.arm * wave, 0.0, 0.0)
            joints.update(
                arm_rotations(side, np.radians(swing), np.radians(max(bend, 2.0)), np.radians(self.abduction))
            )
        return {name: quaternion(q) for name, q in joints.items()}


def quaternion(q: Array) -> Quaternion:
    x, y, z, w = (float(value) for value in rot.normalised(q))
    return (x, y, z, w)


def standing_foot(body: Humanoid, x: float, footprint: float, pitch: float) -> FootPose:
    """A planted foot whose footprint lies `footprint` m ahead of the pelvis; degrees, toes up positive."""
    up, ahead = planted_ankle(body, np.array(np.radians(pitch)))
    toe = max(-pitch, 0.0)
    return FootPose(
        ankle=(x, float(up), footprint + float(ahead)), pitch=float(np.radians(pitch)), toe=float(np.radians(toe))
    )


def swinging_foot(x: float, height: float, ahead: float, pitch: float, toe: float = 12.0) -> FootPose:
    """A foot in the air, ankle `height` m above the floor and `ahead` m of the pelvis; degrees."""
    return FootPose(ankle=(x, height, ahead), pitch=float(np.radians(pitch)), toe=float(np.radians(toe)))


def _turn(yaw: float, roll: float, lean: float) -> Array:
    """Yaw to the left, then roll left side up, then lean forward; degrees."""
    parts = ((Y_AXIS, yaw), (Z_AXIS, roll), (X_AXIS, lean))
    q = rot.IDENTITY
    for axis, degrees in parts:
        q = rot.multiply(q, rot.from_axis_angle(axis, np.array(np.radians(degrees))))
    return q
