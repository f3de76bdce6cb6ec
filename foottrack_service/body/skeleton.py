"""Lengths of the user's bones, scaled from the height unless given."""

from __future__ import annotations

from dataclasses import dataclass

from foottrack_protocol.messages import BodyValues
from foottrack_service.config import BodySettings

# Shares of the standing height: R. Drillis and R. Contini, Body Segment Parameters, NYU 1966, as tabulated in
# D. Winter, Biomechanics and Motor Control of Human Movement. The eyes, where the headset sits, are at 0.936.
_THIGH = 0.245
_SHANK = 0.246
_HIP_HEIGHT = 0.530
EYE_HEIGHT = 0.936
_HIP_WIDTH = 0.191 * 0.53
"""Hip joints sit at about half of the pelvis's outer breadth (0.191 of the height)."""
_HIP_BACK = 0.05
"""The hips' centre lies about 9 cm behind the eyes of a person of 1.75 m who stands upright."""

# The head nods about a point in the upper neck. Oculus's head model has it 75 mm below and 80.5 mm behind the eyes; a
# look down to the feet bends the lower neck too, so it is further down.
EYES_ABOVE_NECK = 0.10
EYES_BEFORE_NECK = 0.085

BALL_SHARE = 0.65
"""Of the way from ankle to the toes' tip: there are the metatarsal heads, over which a foot rolls and its toes bend."""


@dataclass(frozen=True, slots=True)
class Skeleton:
    """Lengths in m. ``torso`` is from the eyes down to the hips' centre, ``hip_back`` how far behind them that is.

    The neck, which the head nods about, lies ``neck_down`` below the eyes of a level head, and ``neck_back`` behind.
    """

    height: float
    thigh: float
    shank: float
    torso: float
    hip_width: float
    hip_back: float
    neck_down: float = EYES_ABOVE_NECK
    neck_back: float = EYES_BEFORE_NECK

    @classmethod
    def of(cls, body: BodySettings) -> Skeleton:
        """From the settings; what is nil is scaled from the height."""
        tall = body.height
        return cls(
            height=tall,
            thigh=body.thigh or _THIGH * tall,
            shank=body.shank or _SHANK * tall,
            torso=body.torso or (EYE_HEIGHT - _HIP_HEIGHT) * tall,
            hip_width=body.hip_width or _HIP_WIDTH * tall,
            hip_back=_HIP_BACK * tall if body.hip_back is None else body.hip_back,
            neck_down=body.neck_down or EYES_ABOVE_NECK,
            neck_back=EYES_BEFORE_NECK if body.neck_back is None else body.neck_back,
        )

    @classmethod
    def calibrated(cls, values: BodyValues) -> Skeleton:
        """From a calibration."""
        return cls.of(BodySettings(**values.model_dump()))
