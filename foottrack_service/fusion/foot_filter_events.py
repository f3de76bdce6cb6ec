"""What happens to a foot's filter, as rows of numbers that compiled code can replay.

A row holds one event: an IMU sample, an optical fix or a reset (a new start from fixes that agree). The columns of each
kind are named here; every row has all of them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Stamps = npt.NDArray[np.int64]

COLUMNS = 26

KIND = 0
IMU, FIX, RESET = 0.0, 1.0, 2.0

# An IMU sample, sensor frame.
ACC = 1
GYRO = 4
CLIPPED = 7
ZERO_SIGMA = 8
"""m/s per 10 ms; 0 while the foot swings."""
REST_S = 9
"""s: the gyro showed its bias for so long, and now counts; else 0."""
UP = 10
"""The device's own idea of up, unit, 3 columns; zeros without one."""
FLOOR = 13
"""Height of a standing ankle, m; NaN without a floor."""
MEAN_RATE = 14
"""1 when GYRO is the mean rate since the last sample (increments of the device's q) and no instantaneous one."""

WANDER = 15
"""rad/sqrt(s): by how much GYRO's tilt wanders beyond a gyro's noise."""
ROLL = 16
"""rad/s, 3 columns: how a foot that stands turns."""
REST_RATE = 19
"""rad/s, 3 columns: its mean rate over REST_S."""
WRONG_TILT = 22
"""rad: so far the tilt is off by what a foot feels that rests quietly; else 0."""
WRONG_SPEED = 23
"""m/s: the filter's speed of a foot that rests quietly and has for long; else 0."""

# An optical fix, stage.
POINT = 1
POINT_COV = 4
"""9 columns."""
ACCEPTED = 13
"""0, or one of these."""
TEACHES, PLACES = 1.0, 2.0
"""Accepted; and accepted for the place alone: its stamp is in doubt, or was until now, and says nothing on delays."""
FACE = 14
"""The tag's normal, sensor frame, about which its turn is seen best, 3 columns."""
MEASURED_Q = 17
"""The sensor's attitude by the tag, 4 columns."""
TURN_SIGMA = 21
"""rad; 0 without an attitude, negative where it leans too much to be believed."""
PLACED_DELAY = 22
"""The time offset with which the fix was put into the timeline, s."""
ARM = 23
"""The point that was seen, from the sensor, sensor frame, m, 3 columns; a reset has it too."""

# A reset: POINT, then
SPEED = 4
"""m/s, 3 columns."""
POINT_SIGMA = 7
SPEED_SIGMA = 8
YAW_SIGMA = 9
"""rad; MEASURED_Q gives the yaw when TURN_SIGMA is not 0."""
TILT_SIGMA = 10
"""rad: added to what the tilt is unsure by."""
WHOLE = 2.0
"""As TURN_SIGMA: MEASURED_Q gives the whole attitude, and TILT_SIGMA is all that the tilt is unsure by."""
