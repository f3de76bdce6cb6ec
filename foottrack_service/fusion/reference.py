"""The reference filter: A. Bayer, *Foot Tracking in Virtual Reality*, TU Wien 2021, kept as every report's baseline.

State: position, velocity and acceleration of the tag in the stage. Tag and ankle are one point to it, so the ankle
that it publishes is the tag's point less the configured offset, turned by the device's orientation. Measurements are
taken in order of arrival with the newest head pose, nothing is gated, and the process noise is added at every step and
every read whatever its length. All of that is what the thesis did, not what one should do.

Its matrices treat the three axes alike, so the 9 x 9 covariance is a 3 x 3 one over (p, v, a) times the identity:
``numpy.kron(P, I3)`` is the thesis's matrix. It is written out in plain floats, since a sample is on its way to an
engine meanwhile and arrays of nine numbers cost ten times that; the tests hold it against a plain 9-state filter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings, Placement
from foottrack_service.fusion.attitude import Attitude
from foottrack_service.fusion.interface import (
    FootEstimate,
    ImuSample,
    Kind,
    Moves,
    OpticalFix,
    Target,
    Verdict,
    Whereabouts,
)
from foottrack_service.fusion.ladder import BALL_68_OF_ONE_AXIS, Ladder
from foottrack_service.rotations import Array

PROCESS_NOISE = (2e-4, 6e-5, 0.02)
"""Of p [m^2], v [m^2/s^2], a [m^2/s^4], per axis. The thesis's sigmas, used as variances as it used them."""
MARKER_NOISE = 1.5e-4
"""m^2, per axis."""
DEPTH_NOISE = 0.35
"""m^2, per axis."""
ACCELERATION_NOISE = 0.35
"""m^2/s^4, per axis."""
INITIAL_VARIANCE = (1.0, 0.5625, 225.0)
"""Of p, v, a, per axis."""
STATIONARY_BELOW = 0.5
"""m/s^2: a foot that accelerates less is taken to stand."""
READ_HZ = 90.0
AVERAGE = 0.2
"""Weight of the newest read in the exponential average of the output."""

POSITION, ACCELERATION = 0, 2
"""What a measurement is of: its row in (p, v, a)."""

_Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
_PROCESS: _Matrix = ((PROCESS_NOISE[0], 0.0, 0.0), (0.0, PROCESS_NOISE[1], 0.0), (0.0, 0.0, PROCESS_NOISE[2]))
_STANDS: _Matrix = ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
_FEET_APART = {"left": -0.1, "right": 0.1}


@dataclass(frozen=True, slots=True)
class ReferenceOptions:
    """Readings of the thesis that differ. The defaults are the ones that work."""

    stationary_jacobian: Literal["stationary", "moving"] = "stationary"
    """Of the covariance while the foot stands. "moving" is the text taken literally: P keeps its cross terms."""
    noise: Literal["additive", "through_transition"] = "additive"
    """A P A' + Q, or A P A' + W Q W' with W = A: noise that enters before the transition."""


class Kinematics:
    """Position [m], velocity [m/s], acceleration [m/s^2] of a point, and their covariance, the same for each axis."""

    def __init__(self, options: ReferenceOptions, place: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        self._options = options
        self.p = list(place)
        self.v = [0.0, 0.0, 0.0]
        self.a = [0.0, 0.0, 0.0]
        pp, vv, aa = INITIAL_VARIANCE
        self._covariance: _Matrix = ((pp, 0.0, 0.0), (0.0, vv, 0.0), (0.0, 0.0, aa))

    @property
    def state(self) -> Array:
        """Rows p, v, a. Shape (3, 3)."""
        return np.array([self.p, self.v, self.a])

    @property
    def covariance(self) -> Array:
        """Over (p, v, a). Shape (3, 3)."""
        return np.array(self._covariance)

    @property
    def variance(self) -> float:
        """Of the position, per axis, m^2."""
        return self._covariance[0][0]

    def step(self, dt: float, stationary: bool) -> None:
        """Predict over dt, s: p += v dt + a dt^2 / 2, v += a dt; a stationary point keeps p, and v = a = 0."""
        half = 0.5 * dt * dt
        literal = stationary and self._options.stationary_jacobian == "moving"
        if stationary:
            self.v, self.a = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        else:
            self.p = [p + v * dt + a * half for p, v, a in zip(self.p, self.v, self.a, strict=True)]
            self.v = [v + a * dt for v, a in zip(self.v, self.a, strict=True)]
        if stationary and not literal:
            jacobian = _STANDS
        else:
            jacobian = ((1.0, dt, half), (0.0, 1.0, dt), (0.0, 0.0, 1.0))
        self._covariance = _transformed(jacobian, self._covariance)
        if self._options.noise == "additive":
            noise = _PROCESS
        else:
            noise = _transformed(jacobian, _PROCESS)
        self._covariance = _sum(self._covariance, noise)

    def correct(self, row: int, measured: Sequence[float], noise: float) -> None:
        """Fuse a measured position (POSITION) or acceleration (ACCELERATION) with its variance, per axis."""
        cov = self._covariance
        seen = cov[row]
        scale = 1.0 / (seen[row] + noise)
        gain_p, gain_v, gain_a = seen[0] * scale, seen[1] * scale, seen[2] * scale
        before = self.p if row == POSITION else self.a
        off = [m - b for m, b in zip(measured, before, strict=True)]
        self.p = [p + gain_p * o for p, o in zip(self.p, off, strict=True)]
        self.v = [v + gain_v * o for v, o in zip(self.v, off, strict=True)]
        self.a = [a + gain_a * o for a, o in zip(self.a, off, strict=True)]
        pp, pv, pa = cov[0][0] - gain_p * seen[0], cov[0][1] - gain_p * seen[1], cov[0][2] - gain_p * seen[2]
        vv, va, aa = cov[1][1] - gain_v * seen[1], cov[1][2] - gain_v * seen[2], cov[2][2] - gain_a * seen[2]
        self._covariance = ((pp, pv, pa), (pv, vv, va), (pa, va, aa))

    def move(self, p: Array, q: Array) -> None:
        """Go with a stage that moved rigidly, old to new."""
        self.p = (p + rot.rotate(q, self.p)).tolist()
        self.v = rot.rotate(q, self.v).tolist()
        self.a = rot.rotate(q, self.a).tolist()


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
        self._kinematics = Kinematics(self._options)
        self._stationary = False
        self._average: Array | None = None
        self._next_read = 0

    @property
    def standing(self) -> bool:
        """Whether the foot stood still when the newest sample was taken."""
        return self._stationary

    def on_imu(self, sample: ImuSample) -> bool:
        """Predict to the sample, then fuse its acceleration unless the foot stands."""
        self._attitude.update(sample)
        ax, ay, az = rot.rotate(self._attitude.sensor_to_stage, sample.acc).tolist()
        ay -= STANDARD_GRAVITY
        self._stationary = math.sqrt(ax * ax + ay * ay + az * az) < STATIONARY_BELOW
        if self._t is None:
            self._begin(self._start + rot.rotate(self._attitude.foot_to_stage, self._tag_arm), sample.t)
        self._step_to(sample.t)
        if not self._stationary:
            self._kinematics.correct(ACCELERATION, (ax, ay, az), ACCELERATION_NOISE)
        self._ladder.saw_imu(sample.t)
        return True

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
        self._kinematics.correct(POSITION, place.tolist(), MARKER_NOISE if fix.kind == "marker" else DEPTH_NOISE)
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
        self._kinematics.move(p, q)
        if self._average is not None:
            self._average = p + rot.rotate(q, self._average)

    def on_head_lost(self) -> None:
        """Makes no difference here."""

    def beside(self, other: Whereabouts, moves: Moves) -> None:
        """Nothing is gated here: whoever is called left is the left foot."""

    def moves(self, frm: int, to: int) -> bool | None:
        """Nobody asks."""
        return None

    def target(self, kind: Kind, t: int) -> Target | None:
        """Never well known."""
        return None

    def estimate(self, t: int) -> FootEstimate | None:
        """Predict to ``t``, average at 90 Hz, and give the average."""
        if self._t is None:
            return None
        if self._average is None or t >= self._next_read:
            self._step_to(t)
            place = np.array(self._kinematics.p)
            if self._average is None:
                self._average, self._next_read = place, t
            self._average = (1.0 - AVERAGE) * self._average + AVERAGE * place
            period = round(1e9 / READ_HZ)
            # The grid stays where it was, so that outputs at 100 Hz are still read 90 times a second.
            self._next_read += period * (1 + max(0, t - self._next_read) // period)
        q = self._attitude.foot_to_stage
        ankle = self._average - rot.rotate(q, self._tag_arm)
        sigma = min(BALL_68_OF_ONE_AXIS * math.sqrt(max(0.0, self._kinematics.variance)), 1e6)
        return FootEstimate(
            t=t,
            p=ankle,
            q=q,
            v=np.array(self._kinematics.v),
            contact=self._stands(ankle, t),
            stage=self._ladder.stage(t, sigma),
            sigma=sigma,
            age=self._ladder.age(t),
        )

    def _begin(self, place: Array, t: int) -> None:
        self._kinematics = Kinematics(self._options, place.tolist())
        self._t, self._average = t, None

    def _step_to(self, t: int) -> None:
        assert self._t is not None
        dt = max(0, t - self._t) * 1e-9
        self._t = max(t, self._t)
        self._kinematics.step(dt, self._stationary)

    def _stands(self, ankle: Array, t: int) -> bool:
        if self._ladder.imu_alive(t):
            return self._stationary
        low = float(ankle[1]) - self._floor < self._ankle_height + 0.03
        return low and math.hypot(*self._kinematics.v) < 0.2


def _transformed(a: _Matrix, p: _Matrix) -> _Matrix:
    """A P A' for an upper triangular A and a symmetric P."""
    (a00, a01, a02), (_, a11, a12), (_, _, a22) = a
    (p00, p01, p02), (_, p11, p12), (_, _, p22) = p
    b00, b01, b02 = (
        a00 * p00 + a01 * p01 + a02 * p02,
        a00 * p01 + a01 * p11 + a02 * p12,
        a00 * p02 + a01 * p12 + a02 * p22,
    )
    b11, b12 = a11 * p11 + a12 * p12, a11 * p12 + a12 * p22
    b22 = a22 * p22
    c00, c01, c02 = b00 * a00 + b01 * a01 + b02 * a02, b01 * a11 + b02 * a12, b02 * a22
    c11, c12, c22 = b11 * a11 + b12 * a12, b12 * a22, b22 * a22
    return ((c00, c01, c02), (c01, c11, c12), (c02, c12, c22))


def _sum(a: _Matrix, b: _Matrix) -> _Matrix:
    (a00, a01, a02), (_, a11, a12), (_, _, a22) = a
    (b00, b01, b02), (_, b11, b12), (_, _, b22) = b
    c01, c02, c12 = a01 + b01, a02 + b02, a12 + b12
    return ((a00 + b00, c01, c02), (c01, a11 + b11, c12), (c02, c12, a22 + b22))
