"""Frames, units and fixed rotations of the wire, in one place.

Right-handed, +X right, +Y up, -Z forward (OpenXR, Godot). Metres, seconds, radians. Quaternions ``[x, y, z, w]``,
body to parent. *stage*: origin on the floor. *head*: OpenXR's view frame. *foot*: origin at the ankle joint's centre,
+Y up and -Z towards the toes when the user stands at ease. *tag*: ArUco's, +X to its right, +Y to its top, +Z out of
its face.
"""

from __future__ import annotations

import math
from typing import Literal

STANDARD_GRAVITY = 9.80665
"""m/s^2."""

UP = (0.0, 1.0, 0.0)
RIGHT = (1.0, 0.0, 0.0)
FORWARD = (0.0, 0.0, -1.0)

TAG_ON_INSTEP = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""Rotation tag to foot of a tag that lies flat on the instep with its top towards the toes."""

SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")

MAX_HEAD_GAP_S = 0.1
"""The head pose is interpolated between tracked poses at most this far apart, never across a hole."""
