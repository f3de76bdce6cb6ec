"""The reference filter: A. Bayer, *Foot Tracking in Virtual Reality*, TU Wien 2021, kept as every report's baseline.

State: position, velocity and acceleration of the tag in the stage. Tag and ankle are one point to it, so the ankle
that it publishes is the tag's point less the configured offset, turned by the device's orientation. Measurements are
taken in order of arrival with the newest head pose, nothing is gated, and the process noise is added at every step and
every read whatever its length. All of that is what the thesis did, not what one should do.

Its matrices treat the three axes alike, so the 9 x 9 covariance is a 3 x 3 one over (p, v, a) times the identity:
``numpy.kron(P, I3)`` is the thesis's matrix. The tests hold it against a plain 9-state filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings, Placement
from foottrack_service.fusion.attitude import Attitude
from foottrack_service.fusion.interface import FootEstimate, ImuSample, OpticalFix, Verdict
from foottrack_service.fusion.ladder import BALL_68_OF_ONE_AXIS, Ladder
from foottrack_service.rotations import Array

PROCESS_NOISE = np.diag([2e-4, 6e-5, 0.02])
"""Of p [m^2], v [m^2/s^2], a [m^2/s^4], per axis. The thesis's sigmas, used as variances as it used them."""
MARKER_NOISE = 1.5e-4
"""m^2, per axis."""
DEPTH_NOISE = 0.35
"""m^2, per axis."""
ACCELERATION_NOISE = 0.35
"""m^2/s^4, per axis."""
INITIAL_COVARIANCE = np.diag([1.0, 0.5625, 225.0])
STATIONARY_BELOW = 0.5
"""m/s^2: a foot that accelerates less is taken to stand."""
READ_HZ = 90.0
AVERAGE = 0.2
"""Weight of the newest read in the exponential average of the output."""

_STATIONARY = np.diag([1.0, 0.0, 0.0])
_UP_GRAVITY = np.array([0.0, STANDARD_GRAVITY, 0.0])
_FEET_APART = {"left": -0.1, "right": 0.1}


@dataclass(frozen=True, slots=True)
class ReferenceOptions:
    """Readings of the thesis that differ. The defaults are the ones that work."""

    stationary_jacobian: Literal["stationary", "moving"] = "stationary"
    """Of the covariance while the foot stands. "moving" is the text taken literally: P keeps its cross terms."""
    noise: Literal["additive", "through_transition"] = "additive"
    """A P A' + Q, or A P A' + W Q W' with W = A: noise that enters before the transition."""


def transition(dt: float) -> Array:
    """Shape (3, 3) over (p, v, a): p += v dt + a dt^2 / 2, v += a dt."""
    return np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


class ReferenceFilter:
    """One foot. ``estimate`` is the thesis's read-out and changes the state, as it did there."""

    waits_for_head = False

    def __init__(self, foot: FootSettings, side: Side, options: ReferenceOptions | None = None) -> None:
        self._options = options or ReferenceOptions()
        self._tag_arm = np.array(foot.marker.p)
        self._tag_to_foot = np.array(foot.marker.q)
        self._start = np.array([_FEET_APART[side], foot.ankle_height, 0.0])
        self._ankle_height = foot.ankle_height
        self._floor = 0.0
        self._attitude = Attitude(foot.imu)
        self._ladder = Ladder()
        self._t: int | None = None
        self.state: Array = np.zeros((3, 3))
        """Rows p [m], v [m/s], a [m/s^2] of the tag, stage."""
        self.covariance: Array = INITIAL_COVARIANCE.copy()
        """Over (p, v, a), the same for each axis."""
        self._stationary = False
        self._average: Array | None = None
        self._next_read = 0

    def on_imu(self, sample: ImuSample) -> None:
        """Predict to the sample, then fuse its acceleration unless the foot stands."""
        self._attitude.update(sample)
        acceleration = rot.rotate(self._attitude.sensor_to_stage, sample.acc) - _UP_GRAVITY
        self._stationary = math.sqrt(float(acceleration @ acceleration)) < STATIONARY_BELOW
        if self._t is None:
            self._begin(self._start + rot.rotate(self._attitude.foot_to_stage, self._tag_arm), sample.t)
        self._step_to(sample.t)
        if not self._stationary:
            self._correct(2, acceleration, ACCELERATION_NOISE)
        self._ladder.saw_imu(sample.t)

    def on_fix(self, fix: OpticalFix, now: int) -> Verdict:
        """Fuse the tag's place with the newest head pose, as if it had been seen at ``now``."""
        if fix.kind == "depth" and self._ladder.fix_within("marker", now):
            return Verdict.UNUSED
        head = fix.head_at_arrival
        place = head.p + rot.rotate(head.q, fix.p)
        if fix.q is not None:
            solutions = [q for q in (fix.q, fix.q_alt) if q is not None]
            to_foot = rot.conjugate(self._tag_to_foot)
            self._attitude.see([rot.multiply(head.q, rot.multiply(q, to_foot)) for q in solutions])
        if self._t is None:
            self._begin(place, now)
        else:
            self._step_to(now)
        self._correct(0, place, MARKER_NOISE if fix.kind == "marker" else DEPTH_NOISE)
        self._ladder.saw_fix(fix.kind, fix.t)
        return Verdict.ACCEPTED

    def on_floor(self, height: float) -> None:
        """Floor height in the stage, m: where a foot without a camera starts."""
        self._start[1] += height - self._floor
        self._floor = height

    def on_imu_yaw(self, yaw: float) -> None:
        """The device's yaw in the stage was calibrated, rad."""
        self._attitude.fix_yaw(yaw)

    def on_imu_placement(self, placement: Placement) -> None:
        """The sensor's place on the shoe was calibrated."""
        self._attitude.place(placement)

    def on_recentred(self, p: Array | None, q: Array | None) -> None:
        """Move with the stage, or start again from the next measurement."""
        if p is None or q is None:
            self._t, self._average = None, None
            self._attitude.forget_yaw()
            return
        self._attitude.turn(q)
        self.state = rot.rotate(q, self.state)
        self.state[0] += p
        if self._average is not None:
            self._average = p + rot.rotate(q, self._average)

    def estimate(self, t: int) -> FootEstimate | None:
        """Predict to ``t``, average at 90 Hz, and give the average."""
        if self._t is None:
            return None
        if self._average is None or t >= self._next_read:
            self._step_to(t)
            if self._average is None:
                self._average = self.state[0].copy()
                self._next_read = t
            self._average = (1.0 - AVERAGE) * self._average + AVERAGE * self.state[0]
            period = round(1e9 / READ_HZ)
            # The grid stays where it was, so that outputs at 100 Hz are still read 90 times a second.
            self._next_read += period * (1 + max(0, t - self._next_read) // period)
        q = self._attitude.foot_to_stage
        ankle = self._average - rot.rotate(q, self._tag_arm)
        sigma = min(BALL_68_OF_ONE_AXIS * math.sqrt(max(0.0, float(self.covariance[0, 0]))), 1e6)
        return FootEstimate(
            t=t,
            p=ankle,
            q=q,
            v=self.state[1].copy(),
            contact=self._stands(ankle, t),
            stage=self._ladder.stage(t, sigma),
            sigma=sigma,
            age=self._ladder.age(t),
        )

    def _begin(self, place: Array, t: int) -> None:
        self.state = np.zeros((3, 3))
        self.state[0] = place
        self.covariance = INITIAL_COVARIANCE.copy()
        self._t, self._average = t, None

    def _step_to(self, t: int) -> None:
        assert self._t is not None
        dt = max(0, t - self._t) * 1e-9
        self._t = max(t, self._t)
        moving = transition(dt)
        process = _STATIONARY if self._stationary else moving
        literal = self._stationary and self._options.stationary_jacobian == "moving"
        jacobian = moving if literal else process
        self.state = process @ self.state
        noise = PROCESS_NOISE
        if self._options.noise == "through_transition":
            noise = jacobian @ PROCESS_NOISE @ jacobian.T
        self.covariance = jacobian @ self.covariance @ jacobian.T + noise

    def _correct(self, row: int, measured: Array, noise: float) -> None:
        gain = self.covariance[:, row] / (self.covariance[row, row] + noise)
        self.state += np.outer(gain, measured - self.state[row])
        self.covariance -= np.outer(gain, self.covariance[row])
        self.covariance = 0.5 * (self.covariance + self.covariance.T)

    def _stands(self, ankle: Array, t: int) -> bool:
        if self._ladder.imu_alive(t):
            return self._stationary
        low = float(ankle[1]) - self._floor < self._ankle_height + 0.03
        return low and float(np.linalg.norm(self.state[1])) < 0.2
