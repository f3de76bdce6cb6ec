"""From key poses to a cycle: curves of everything over the phase, for one body, on a straight line.

The pelvis' way against the planted foot is what the poses say it is (Lee's root compensation, made continuous):
its mean speed gives the stride, what is left is *surge*, *sway* and *bounce*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.curves import Curve, periodic, periodic_rotation
from foottrack_service.walkcycle.errors import ProjectError, ReachError, WalkError
from foottrack_service.walkcycle.project import FootPose, Key, Project, full_cycle
from foottrack_service.walkcycle.rollover import FootCurves, FootKeys, foot_curves, planted_ankle
from foottrack_service.walkcycle.skeleton import INDEX, POSED_JOINTS, SIDES, Humanoid

Array = npt.NDArray[np.float64]

STRIKE = {"left": 0.0, "right": 0.5}
"""Phase of each foot's strike."""


@dataclass(frozen=True)
class Cycle:
    """One body's walk cycle.

    `stride` m and `period` s of two steps; `hips(phase)` (n, 3) m: sway, height, surge about the guide; `joints`
    per posed joint (hips included) phase -> (n, 4); `feet` per side; `stance_x` and `stance_yaw` of the
    footprints per side; `lead` m: how far the guide is ahead of the middle between both footprints at a strike.
    """

    body: Humanoid
    project: Project
    stride: float
    period: float
    hips: Curve
    joints: dict[str, Curve]
    feet: dict[str, FootCurves]
    stance_x: dict[str, float]
    stance_yaw: dict[str, float]
    lead: float

    @property
    def step(self) -> float:
        return 0.5 * self.stride

    @property
    def speed(self) -> float:
        """m/s."""
        return self.stride / self.period


def build_cycle(project: Project, body: Humanoid | None = None) -> Cycle:
    """The cycle of a project on a body (the project's own by default; another is scaled to by leg length, its
    period by the root of that, so that both walk at the same Froude number).

    Raises ProjectError and ReachError; both name the pose.
    """
    body = body or Humanoid(project.height)
    posed = Humanoid(project.height)
    ratio = body.leg / posed.leg
    keys = sorted(full_cycle(project).keys, key=lambda key: key.phase)
    for key in keys:
        _check_reach(posed, key)
    phases = np.array([key.phase for key in keys])
    hips = np.array([key.pose.hips for key in keys]) * ratio
    hips[:, 1] += body.ankle_height - ratio * posed.ankle_height
    feet = {side: [key.pose.left if side == "left" else key.pose.right for key in keys] for side in SIDES}
    ankles = {side: _ankles(feet[side], posed, body, ratio) for side in SIDES}
    timing = project.contact

    stride = 2.0 * ratio * _contact_step(posed, keys[0])
    if stride < 0.05 * body.leg:
        raise ProjectError(
            f"pose {keys[0].name!r}: the left foot is not in front of the right one (step {0.5 * stride:.3f} m)"
        )

    # Where the pelvis is over the footprint of the foot that stands, against a steady advance.
    surge_sum, surge_count = np.zeros_like(phases), np.zeros_like(phases)
    for side in SIDES:
        since = np.mod(phases - STRIKE[side], 1.0)
        standing = since <= timing.toe_off
        pitch = np.array([foot.pitch for foot in feet[side]])
        ahead = planted_ankle(body, pitch)[:, 1] - (ankles[side][:, 2] - hips[:, 2])
        surge_sum += np.where(standing, ahead - stride * since, 0.0)
        surge_count += standing
    if np.any(surge_count == 0):
        # In flight the pelvis goes on as it went.
        known = surge_count > 0
        if not np.any(known):
            raise ProjectError("no pose has a foot on the floor")
        surge_sum = np.interp(phases, phases[known], (surge_sum / np.maximum(surge_count, 1))[known], period=1.0)
        surge_count = np.ones_like(phases)
    surge = surge_sum / surge_count
    lead = float(np.mean(surge)) + 0.25 * stride

    curves: dict[str, FootCurves] = {}
    stance_x: dict[str, float] = {}
    stance_yaw: dict[str, float] = {}
    for side in SIDES:
        since = np.mod(phases - STRIKE[side], 1.0)
        flat = (since >= timing.flat) & (since <= timing.heel_off)
        flat = flat if np.any(flat) else since <= timing.toe_off
        yaw = np.array([foot.yaw for foot in feet[side]])
        stance_x[side], stance_yaw[side] = float(np.mean(ankles[side][flat, 0])), float(np.mean(yaw[flat]))
        world = ankles[side].copy()
        world[:, 0] -= stance_x[side]
        world[:, 2] += stride * since + surge - hips[:, 2]
        foot_keys = FootKeys(
            since, world, _angles(feet[side], "pitch"), _angles(feet[side], "toe"), yaw - stance_yaw[side]
        )
        try:
            curves[side] = foot_curves(body, timing, foot_keys, stride)
        except WalkError as error:
            raise ProjectError(f"{side} foot: {error}") from None

    place = np.stack([hips[:, 0], hips[:, 1], surge - np.mean(surge)], axis=-1)
    return Cycle(
        body=body,
        project=project,
        stride=stride,
        period=project.period * float(np.sqrt(ratio)),
        hips=periodic(phases, place),
        joints=_joint_curves(project, keys, phases),
        feet=curves,
        stance_x=stance_x,
        stance_yaw=stance_yaw,
        lead=lead,
    )


def _angles(feet: list[FootPose], name: str) -> Array:
    return np.array([getattr(foot, name) for foot in feet], dtype=np.float64)


def _ankles(feet: list[FootPose], posed: Humanoid, body: Humanoid, ratio: float) -> Array:
    """Ankles (k, 3) of the posed body's feet on another body: the legs' length scales the way, the foot its own
    roll."""
    ankles, pitch = np.array([foot.ankle for foot in feet]), _angles(feet, "pitch")
    rolls = planted_ankle(body, pitch) - ratio * planted_ankle(posed, pitch)
    return np.asarray(ratio * ankles + np.stack([np.zeros(len(feet)), rolls[:, 0], rolls[:, 1]], axis=-1))


def _contact_step(body: Humanoid, contact: Key) -> float:
    """Length of the first step: between the two footprints of the contact pose, with the roll taken off."""
    ends = {}
    for side, foot in (("left", contact.pose.left), ("right", contact.pose.right)):
        ends[side] = foot.ankle[2] - float(planted_ankle(body, np.array(foot.pitch))[1])
    return ends["left"] - ends["right"]


def _check_reach(body: Humanoid, key: Key) -> None:
    hips_rotation = np.array(key.pose.rotations.get("hips", (0.0, 0.0, 0.0, 1.0)))
    for side, foot in (("left", key.pose.left), ("right", key.pose.right)):
        hip = np.array(key.pose.hips) + rot.rotate(hips_rotation, body.offsets[INDEX[f"{side}UpperLeg"]])
        distance = float(np.linalg.norm(np.array(foot.ankle) - hip))
        if distance > 1.02 * body.leg:
            raise ReachError(
                f"pose {key.name!r}: the {side} ankle is {distance:.3f} m from the hip,"
                f" and the leg is {body.leg:.3f} m long"
            )


def _joint_curves(project: Project, keys: list[Key], phases: Array) -> dict[str, Curve]:
    curves: dict[str, Curve] = {}
    for name in POSED_JOINTS:
        values = np.array([key.pose.rotations.get(name, (0.0, 0.0, 0.0, 1.0)) for key in keys])
        try:
            curve = periodic_rotation(phases, values)
        except ValueError as error:
            raise ProjectError(f"{name}: {error}") from None
        shift = project.offsets.get(name, 0.0)
        curves[name] = _shifted(curve, shift) if shift else curve
    return curves


def _shifted(curve: Curve, shift: float) -> Curve:
    return lambda phase: curve(phase - shift)
