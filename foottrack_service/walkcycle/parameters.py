"""The knobs on every walk: speed, steps, bounce, sway and toe-out, turned on its poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from foottrack_service.walkcycle.cycle import STRIKE, build_cycle
from foottrack_service.walkcycle.errors import ProjectError
from foottrack_service.walkcycle.project import FootPose, Key, Pose, Project
from foottrack_service.walkcycle.rollover import planted_ankle
from foottrack_service.walkcycle.skeleton import Humanoid

FPS = 24.0
"""Frames per second in which animators count a cycle."""


@dataclass(frozen=True)
class Parameters:
    """What to change; None leaves it as it is posed. `speed` m/s, `frames` per cycle at 24 fps, `step_length` m,
    `step_height` m (highest lift of the ankle over its height when standing), `bounce` m and `sway` m (from lowest
    to highest, from side to side), `toe_out` degrees."""

    speed: float | None = None
    frames: float | None = None
    step_length: float | None = None
    step_height: float | None = None
    bounce: float | None = None
    sway: float | None = None
    toe_out: float | None = None


def with_parameters(project: Project, parameters: Parameters) -> Project:
    """The project with its poses and period changed.

    A speed without a step length keeps the walk ratio, step length over cadence, as people do (Sekiya and Nagasaki
    1998): both grow with the root of the speed. Raises ProjectError for what cannot be done.
    """
    p = parameters
    for name, value in vars(p).items():
        least = -60.0 if name == "toe_out" else 0.0
        if value is not None and not (
            np.isfinite(value) and (value > least or (value == 0.0 and name in ("bounce", "sway")))
        ):
            raise ProjectError(f"{name.replace('_', ' ')} must be above {least:g}, not {value:g}")
    if p.speed is not None and p.frames is not None:
        raise ProjectError("give a speed or frames per cycle, not both")
    cycle = build_cycle(project)
    length = p.step_length
    if length is None and p.speed is not None:
        length = cycle.step * float(np.sqrt(p.speed / cycle.speed))
    if length is not None and length > 1.25 * cycle.body.leg:
        raise ProjectError(f"a step of {length:.2f} m is out of reach for a leg of {cycle.body.leg:.2f} m")
    step_ratio = 1.0 if length is None else length / cycle.step
    period = project.period
    if p.frames is not None:
        period = p.frames / FPS
    elif p.speed is not None:
        period = 2.0 * cycle.step * step_ratio / p.speed
    stand = cycle.body.ankle_height
    lifts = [foot.ankle[1] - stand for key in project.keys for foot in (key.pose.left, key.pose.right)]
    heights = [key.pose.hips[1] for key in project.keys]
    sways = [abs(key.pose.hips[0]) for key in project.keys]
    change = _Change(
        body=cycle.body,
        step=step_ratio,
        lift=_ratio(p.step_height, max(lifts), "lift"),
        bounce=_ratio(p.bounce, max(heights) - min(heights), "bounce"),
        sway=_ratio(p.sway, 2.0 * max(sways), "sway"),
        height=float(np.mean(heights)),
        turn={} if p.toe_out is None else {s: np.radians(p.toe_out) * (1 if s == "left" else -1) for s in STRIKE},
        stance_yaw=cycle.stance_yaw,
        toe_off=project.contact.toe_off,
    )
    keys = tuple(key.model_copy(update={"pose": change.pose(key)}) for key in project.keys)
    return Project.model_validate({**project.model_dump(), "period": period, "keys": [k.model_dump() for k in keys]})


@dataclass(frozen=True)
class _Change:
    body: Humanoid
    step: float
    lift: float
    bounce: float
    sway: float
    height: float
    turn: dict[str, float]
    stance_yaw: dict[str, float]
    toe_off: float

    def pose(self, key: Key) -> Pose:
        x, y, z = key.pose.hips
        hips = (x * self.sway, self.height + (y - self.height) * self.bounce, z)
        left, right = (self.foot(side, key) for side in STRIKE)
        return key.pose.model_copy(update={"hips": hips, "left": left, "right": right})

    def foot(self, side: str, key: Key) -> FootPose:
        foot = key.pose.left if side == "left" else key.pose.right
        x, y, z = foot.ankle
        ahead = float(planted_ankle(self.body, np.array(foot.pitch))[1])
        # The roll of a foot is the foot's own length and does not grow with the step.
        z = key.pose.hips[2] + (z - key.pose.hips[2] - ahead) * self.step + ahead
        if (key.phase - STRIKE[side]) % 1.0 > self.toe_off:
            stand = self.body.ankle_height
            y = stand + (y - stand) * self.lift
        yaw = foot.yaw - self.stance_yaw[side] + self.turn[side] if self.turn else foot.yaw
        return FootPose(ankle=(x, y, z), pitch=foot.pitch, yaw=yaw, toe=foot.toe)


def _ratio(wanted: float | None, posed: float, what: str) -> float:
    if wanted is None:
        return 1.0
    if posed < 1e-6:
        raise ProjectError(f"the poses have no {what} that could be scaled")
    return wanted / posed
