"""Walks to start from.

`normative` is posed by published joint angles; `animator` by the four poses of the textbook, whose highest point
is the up and not, as in people, the passing position: the two are never judged by each other's curves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations as rot
from foottrack_service.walkcycle.curves import smooth_step
from foottrack_service.walkcycle.cycle import STRIKE
from foottrack_service.walkcycle.errors import ProjectError
from foottrack_service.walkcycle.normative import PELVIC_TILT_DEG, normative_mean
from foottrack_service.walkcycle.posing import UpperBody, standing_foot, swinging_foot
from foottrack_service.walkcycle.project import ContactTiming, FootPose, Key, Pose, Project, Quaternion
from foottrack_service.walkcycle.rollover import planted_ankle
from foottrack_service.walkcycle.skeleton import INDEX, SIDES, Humanoid

Array = npt.NDArray[np.float64]

NAMES: Final = {0.0: "contact", 0.125: "down", 0.25: "pass", 0.375: "up"}
_HALF_WIDTH_M: Final = 0.055
_HEEL_WHIP_M: Final = 0.012


def preset(name: str) -> Project:
    """A preset by name. Raises ProjectError, which lists them."""
    try:
        return PRESETS[name]()
    except KeyError:
        raise ProjectError(f"no preset is called {name!r}; there are {', '.join(PRESETS)}") from None


def normative() -> Project:
    """Joint angles of Schwartz 2008 at sixteen phases of the cycle, stance 60 %, 1.10 s; with legs of 0.86 m the
    angles themselves make a stride of 1.40 m.

    The arms swing as Murray 1967 has them: the shoulder from about 24 deg back at its own side's strike to 8 ahead at
    the other's, the elbow from about 17 to 47. That the elbow is a little ahead of the shoulder is ours: without it the
    wrist's two ways lie on each other.
    """
    body, timing = Humanoid(), ContactTiming()
    upper = UpperBody(arm=16, arm_forward=-10, elbow=32, elbow_swing=15, elbow_drag=0, elbow_lead=0.04)
    keys = []
    heights = _once_a_step([_standing_height(body, upper, eighth / 16.0, timing) for eighth in range(8)])
    for eighth, height in enumerate(heights):
        phase = eighth / 16.0
        joints = upper.rotations(phase)
        legs = {side: _normative_leg(body, phase + STRIKE[side], timing) for side in SIDES}
        hips = _hip_joints(body, joints)
        feet = {}
        sway = 0.018 * float(np.cos(2.0 * np.pi * (phase - 0.3)))
        for side, sign in (("left", 1.0), ("right", -1.0)):
            leg, hip = legs[side], hips[side]
            ankle = height + float(hip[1]) + leg.down
            pitch, toe = leg.pitch, leg.toe
            if leg.rolls:
                # Halfway between what its angles and what the height of the pelvis say.
                pitch = 0.5 * (pitch - _pitch_of_heel_rise(body, ankle))
                toe = -pitch
            place = (sign * (_HALF_WIDTH_M - leg.whip), ankle, float(hip[2]) + leg.ahead)
            feet[side] = FootPose(ankle=place, pitch=pitch, toe=toe)
        pose = Pose(hips=(sway, height, 0.0), rotations=joints, left=feet["left"], right=feet["right"])
        keys.append(Key(name=NAMES.get(phase, f"between-{eighth}"), phase=phase, pose=pose))
    return Project(name="normative", period=1.10, contact=timing, keys=tuple(keys))


def animator() -> Project:
    """The four poses of the textbook, 24 frames a cycle at 24 fps."""
    timing = ContactTiming(flat=0.11, heel_off=0.29, toe_off=0.60)
    upper = UpperBody(pelvis_yaw=7, pelvis_list=4, chest_yaw=8, lean=3, arm=32, elbow=25, elbow_swing=18)
    swing = {
        0.125: (0.24, -0.43, -62.0, 20.0),
        0.25: (0.225, 0.02, -28.0, 10.0),
        0.375: (0.185, 0.32, 8.0, 8.0),
    }
    height = {0.0: 0.882, 0.125: 0.862, 0.25: 0.918, 0.375: 0.932}
    return _textbook("animator", 1.0, timing, upper, 0.70, height, swing, pitches=(24.0, -12.0, -36.0))


def sneak() -> Project:
    """Crouched, slow, toes first, the knees high."""
    timing = ContactTiming(flat=0.16, heel_off=0.42, toe_off=0.66)
    upper = UpperBody(
        pelvis_yaw=5, pelvis_list=3, chest_yaw=6, lean=28, arm=16, arm_forward=22, abduction=8, elbow=80, elbow_swing=15
    )
    swing = {
        0.125: (0.20, -0.28, -48.0, 20.0),
        0.25: (0.34, 0.04, -30.0, 10.0),
        0.375: (0.36, 0.34, -16.0, 10.0),
    }
    height = {0.0: 0.80, 0.125: 0.765, 0.25: 0.80, 0.375: 0.825}
    return _textbook("sneak", 2.0, timing, upper, 0.52, height, swing, pitches=(-14.0, 0.0, -22.0))


def double_bounce() -> Project:
    """Down and up twice in every step."""
    timing = ContactTiming(flat=0.11, heel_off=0.33, toe_off=0.60)
    upper = UpperBody(pelvis_yaw=6, pelvis_list=6, chest_yaw=6, lean=-2, arm=26, elbow=40, elbow_swing=22)
    swing = {
        0.125: (0.24, -0.33, -55.0, 20.0),
        0.25: (0.26, 0.03, -25.0, 10.0),
        0.375: (0.20, 0.30, 4.0, 8.0),
    }
    height = {0.0: 0.915, 0.125: 0.86, 0.25: 0.92, 0.375: 0.87}
    return _textbook("double-bounce", 1.0, timing, upper, 0.56, height, swing, pitches=(18.0, -8.0, -32.0))


PRESETS: Final[dict[str, Callable[[], Project]]] = {
    "normative": normative,
    "animator": animator,
    "sneak": sneak,
    "double-bounce": double_bounce,
}


@dataclass(frozen=True)
class _Leg:
    """A leg posed by its angles: ankle below and `ahead` of the hip (m), `pitch` and `toe` (rad), `height` of the hip
    if this leg stood (m), `whip` inwards (m), and whether it rolls over its ball."""

    down: float
    ahead: float
    pitch: float
    toe: float
    height: float
    whip: float
    rolls: bool


def _hip_joints(body: Humanoid, joints: dict[str, Quaternion]) -> dict[str, Array]:
    """Where the hip joints are about the pelvis' middle, (3,) m, with the pelvis turned and listed."""
    turned = rot.normalised(joints["hips"])
    return {side: rot.rotate(turned, body.offsets[INDEX[f"{side}UpperLeg"]]) for side in SIDES}


def _standing_height(body: Humanoid, upper: UpperBody, phase: float, timing: ContactTiming) -> float:
    """The pelvis is as high as the leg is long that landed last, m."""
    leg = _normative_leg(body, phase, timing)
    return leg.height - float(_hip_joints(body, upper.rotations(phase))["left"][1])


def _once_a_step(heights: list[float]) -> list[float]:
    """The wave in these that rises and falls once a step, as a pelvis does: it has not the joint angles' own jolts,
    which a body's mass would not follow and a file's frames could not show."""
    waves = np.fft.rfft(heights)
    waves[2:] = 0.0
    return [float(height) for height in np.fft.irfft(waves, len(heights))]


def _normative_leg(body: Humanoid, phase: float, timing: ContactTiming) -> _Leg:
    phase %= 1.0
    hip, knee, ankle = (float(normative_mean(name, phase)) for name in ("hip", "knee", "ankle"))
    thigh = np.radians(hip - PELVIC_TILT_DEG)
    shank = thigh - np.radians(knee)
    pitch = float(shank + np.radians(ankle))
    if timing.flat <= phase <= timing.heel_off:
        pitch = 0.0
    down = -float(body.thigh * np.cos(thigh) + body.shank * np.cos(shank))
    ahead = float(body.thigh * np.sin(thigh) + body.shank * np.sin(shank))
    height = float(planted_ankle(body, np.array(pitch))[0]) - down
    swing = (phase - timing.toe_off) / (1.0 - timing.toe_off)
    # The toes come back from push-off over the first half of the swing, and are a little up for the landing.
    relaxed = float(smooth_step(2.0 * swing))
    toe = max(-pitch, 0.0) * (1.0 - relaxed) + np.radians(12.0) * relaxed
    whip = _HEEL_WHIP_M * float(np.sin(2.0 * np.pi * swing)) if swing > 0.0 else 0.0
    return _Leg(down, ahead, pitch, float(toe), height, whip, timing.heel_off < phase <= timing.toe_off)


def _pitch_of_heel_rise(body: Humanoid, ankle_height: float) -> float:
    """How far a foot has rolled over its ball (rad) when its ankle is that high."""
    ball = body.ball
    length, rest = float(np.hypot(ball[1], ball[2])), float(np.arctan2(-ball[1], ball[2]))
    rise = min((ankle_height - body.ball_height) / length, 1.0)
    return max(float(np.arcsin(rise)) - rest, 0.0)


def _textbook(
    name: str,
    period: float,
    timing: ContactTiming,
    upper: UpperBody,
    step: float,
    height: dict[float, float],
    swing: dict[float, tuple[float, float, float, float]],
    pitches: tuple[float, float, float],
) -> Project:
    """A cycle of the four poses. `height` of the pelvis per phase, `swing` (ankle height, ahead, pitch, toe) of the
    other foot, `pitches` of the foot at contact, at up, and behind at the next contact (m, degrees)."""
    body = Humanoid()
    contact, up, behind = pitches
    keys = []
    for phase, key in NAMES.items():
        left = standing_foot(body, _HALF_WIDTH_M, step * (0.5 - 2.0 * phase), {0.0: contact, 0.375: up}.get(phase, 0.0))
        if phase == 0.0:
            right = standing_foot(body, -_HALF_WIDTH_M, -0.5 * step, behind)
        else:
            lift, ahead, pitch, toe = swing[phase]
            whip = {0.125: 1.0, 0.25: 0.6, 0.375: -1.0}[phase] * _HEEL_WHIP_M
            right = swinging_foot(-_HALF_WIDTH_M + whip, lift, ahead, pitch, toe)
        sway = 0.022 * float(np.cos(2.0 * np.pi * (phase - 0.3)))
        pose = Pose(hips=(sway, height[phase], 0.0), rotations=upper.rotations(phase), left=left, right=right)
        keys.append(Key(name=key, phase=phase, pose=pose))
    return Project(name=name, period=period, contact=timing, keys=tuple(keys))
