"""A foot without an IMU, tracked from pictures alone.

Motion model per axis: position, velocity and an acceleration that is forgotten within a stride's swing (R. Singer,
Estimating optimal tracking filter performance for manned maneuvering targets, 1970), and a foot that has not moved for
0.2 s stands. The ankle hangs off the target by the tag's own attitude, chosen as the more upright of the two solutions
or, once one is known, the nearer.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from foottrack_service import rotations as rot
from foottrack_service.config import FootSettings
from foottrack_service.fusion.foot_filter_candidates import Rejected
from foottrack_service.fusion.foot_filter_doubt import NOT_OURS, Doubt
from foottrack_service.fusion.foot_filter_optical import CHI_SQUARE_3, Blob, implausible
from foottrack_service.fusion.foot_filter_output import COASTING_DECAY_S
from foottrack_service.fusion.interface import Kind, OpticalFix, Verdict, Whereabouts
from foottrack_service.rotations import Array

MANOEUVRE_S = 0.12
"""For so long a foot keeps its acceleration."""
MANOEUVRE = 15.0
"""m/s^2 SD."""
STANDING_SPAN_S = 0.2
STANDING_SPEED = 0.06
"""m/s by a straight line through the fixes of that span."""
STANDING_SIGMA = 0.02
"""m/s."""
PICTURE_NOISE = 0.002
"""m per axis beyond what the camera says: head pose and mount."""
ATTITUDE_S = 0.04
"""Time constant with which the tag's attitude is smoothed."""
FLAT_TILT = 0.35
"""rad: a standing foot whose tag leans by less stands flat."""
FURTHEST_TILT = 1.2
"""rad from upright: no foot that one can see from above leans more."""
KNOWN_S = 0.3
"""For so long without a fix the place is known well enough to say that another fix is not the other foot's."""
FURTHEST_AT_ONCE = 0.3
"""m: what is further from where the foot is expected must be confirmed, however unsure that is."""
LATE_S = 0.06
"""So old the newest picture is at most while the foot is in sight."""
FORGET_S = 0.5
"""After so long without a fix the place is unknown again."""
_UP = np.array([0.0, 1.0, 0.0])


class PicturesOnlyFilter:
    """One foot's fixes, in order. Times in ns, vectors in the stage."""

    def __init__(self, foot: FootSettings) -> None:
        self._arm, self._blob = np.array(foot.marker.p), Blob(foot)
        self._to_foot = rot.conjugate(np.array(foot.marker.q))
        self.other: Whereabouts = lambda kind, t: None
        """The other foot's ``target``."""
        self._doubt = Doubt()
        self.lose()

    def lose(self) -> None:
        """Nobody knows where the foot is, or where the stage is."""
        self._doubt.forget()
        self._start_again()

    def _start_again(self) -> None:
        """From fixes that agree."""
        self.newest: int | None = None
        """Stamp of the newest accepted fix, ns."""
        self.contact = False
        self._state = np.zeros((3, 3))
        self._P = np.zeros((3, 3))
        self._q: Array = rot.IDENTITY
        self._has_attitude = False
        self._seen: deque[tuple[int, Array]] = deque(maxlen=32)

    def on_fix(self, fix: OpticalFix) -> Verdict:
        """Take a fix; one that is older than the newest is left out."""
        reason = implausible(fix)
        if reason is not None:
            return reason
        if self.newest is not None and (fix.t - self.newest) * 1e-9 > FORGET_S:
            self._start_again()
        if self.newest is not None and fix.t <= self.newest:
            return Verdict.STALE
        variance = float(np.trace(fix.cov)) / 3.0 + PICTURE_NOISE**2
        attitude = self._attitude(fix)
        z = fix.head.p + rot.rotate(fix.head.q, fix.p)
        if fix.kind == "depth":
            z = z + rot.rotate(self._q if attitude is None else attitude, self._arm - self._blob.point)
            variance += self._blob.sigma**2
        dt = 0.0 if self.newest is None else (fix.t - self.newest) * 1e-9
        state, P = _stepped(self._state, self._P, dt)
        residual = z - state[0]
        off = math.inf if self.newest is None else float(residual @ residual)
        if off > NOT_OURS**2 and self._doubt.is_others(fix.t, z, residual, 0.0, self.other(fix.kind, fix.t)):
            return Verdict.IDENTITY
        if off > min(CHI_SQUARE_3 * (P[0, 0] + variance), FURTHEST_AT_ONCE**2):
            rejected = Rejected(
                fix.t, z, z if self.newest is None else residual, None, 0.0, math.sqrt(variance), self._arm
            )
            agreed = self._doubt.agreed(rejected, fix.kind, None, 0.0)
            if agreed is None:
                return Verdict.UNCONFIRMED if self.newest is None else Verdict.GATE
            self._start_again()
            self._begin(agreed, variance, attitude)
            return Verdict.ACCEPTED
        self._state, self._P = _updated(state, P, 0, residual, variance)
        self.newest = fix.t
        self._turn(attitude, dt)
        self._stand(fix.t, z)
        self._doubt.accept(fix.t, fix.kind, 0.0, moving=True, strange=fix.strange)
        return Verdict.ACCEPTED

    def move(self, p: Array, q: Array) -> None:
        """The stage moved, old to new."""
        self._state = rot.rotate(q, self._state)
        self._state[0] += p
        self._q = rot.multiply(q, self._q)
        self._seen = deque(((t, p + rot.rotate(q, z)) for t, z in self._seen), maxlen=32)
        self._doubt.moved(p, q)

    def target(self, kind: Kind, t: int) -> tuple[Array, float] | None:
        """Where in the stage the tag is expected at ``t``, and its SD per axis, m; None when it was not seen lately."""
        if self.newest is None or (t - self.newest) * 1e-9 > KNOWN_S:
            return None
        state, P = _stepped(self._state, self._P, max((t - self.newest) * 1e-9, 0.0))
        return state[0], math.sqrt(max(P[0, 0], 0.0))

    def predicted(self, t: int) -> tuple[Array, Array, Array, float]:
        """Ankle (m), attitude, velocity (m/s) and SD of the ankle per axis (m) at ``t``, ns; needs a fix before."""
        dt = 0.0 if self.newest is None else (t - self.newest) * 1e-9
        _, P = _stepped(self._state, self._P, min(max(dt, 0.0), FORGET_S))
        # A foot that is not seen any more lands sooner than it flies on.
        coast = max(dt - LATE_S, 0.0)
        flown = min(max(dt, 0.0), LATE_S) + COASTING_DECAY_S * (1.0 - math.exp(-coast / COASTING_DECAY_S))
        state, _ = _stepped(self._state, self._P, flown)
        if self.contact:
            state[0], state[1] = self._state[0], 0.0
        ankle = state[0] - rot.rotate(self._q, self._arm)
        return ankle, self._q, state[1], math.sqrt(max(P[0, 0], 0.0))

    def _begin(self, agreed: list[Rejected], variance: float, attitude: Array | None) -> None:
        first, last = agreed[0], agreed[-1]
        span = (last.t - first.t) * 1e-9
        self._state = np.array([last.point, (last.point - first.point) / span, np.zeros(3)])
        self._P = np.diag([variance, 2.0 * variance / span**2 + 0.25, MANOEUVRE**2])
        self.newest = last.t
        if attitude is not None:
            self._q, self._has_attitude = attitude, True

    def _attitude(self, fix: OpticalFix) -> Array | None:
        """Foot to stage as the tag shows it, None without one that is possible."""
        found = [
            rot.multiply(rot.multiply(fix.head.q, rot.normalised(q)), self._to_foot)
            for q in (fix.q, fix.q_alt)
            if q is not None and np.isfinite(q).all() and np.any(q != 0.0)
        ]
        if self._has_attitude and not self.contact:
            found.sort(key=lambda q: float(rot.angle_between(q, self._q)))
        else:
            found.sort(key=lambda q: -float(rot.rotate(q, _UP)[1]))
        if not found or rot.rotate(found[0], _UP)[1] < math.cos(FURTHEST_TILT):
            if self._has_attitude:
                return None
            # Without any tag the toes point to where the head looks.
            return rot.from_yaw(float(rot.yaw_of(fix.head.q)))
        if self.contact and rot.rotate(found[0], _UP)[1] > math.cos(FLAT_TILT):
            # A small tag that faces the camera tells its turn well and its tilt badly.
            return rot.twist_about_up(found[0])
        return found[0]

    def _turn(self, attitude: Array | None, dt: float) -> None:
        if attitude is None:
            return
        if not self._has_attitude:
            self._q, self._has_attitude = attitude, True
        else:
            self._q = rot.slerp(
                self._q, attitude, 1.0 - math.exp(-dt / (10.0 * ATTITUDE_S if self.contact else ATTITUDE_S))
            )

    def _stand(self, t: int, z: Array) -> None:
        self._seen.append((t, z))
        while (t - self._seen[0][0]) * 1e-9 > STANDING_SPAN_S:
            self._seen.popleft()
        self.contact = False
        if len(self._seen) < 6 or (t - self._seen[0][0]) * 1e-9 < 0.6 * STANDING_SPAN_S:
            return
        times = np.array([(s[0] - t) * 1e-9 for s in self._seen])
        times -= times.mean()
        slope = times @ np.array([s[1] for s in self._seen]) / (times @ times)
        if float(np.linalg.norm(slope)) < STANDING_SPEED:
            self.contact = True
            for row in (1, 2):
                self._state, self._P = _updated(self._state, self._P, row, -self._state[row], STANDING_SIGMA**2)


def _stepped(state: Array, P: Array, dt: float) -> tuple[Array, Array]:
    """State rows p, v, a (each over the three axes) and their covariance, shape (3, 3), dt s later."""
    fade = math.exp(-dt / MANOEUVRE_S)
    v_a = MANOEUVRE_S * (1.0 - fade)
    p_a = MANOEUVRE_S * (dt - v_a)
    F = np.array([[1.0, dt, p_a], [0.0, 1.0, v_a], [0.0, 0.0, fade]])
    q = 2.0 * MANOEUVRE**2 / MANOEUVRE_S
    Q = q * np.array(
        [
            [dt**5 / 20.0, dt**4 / 8.0, dt**3 / 6.0],
            [dt**4 / 8.0, dt**3 / 3.0, dt**2 / 2.0],
            [dt**3 / 6.0, dt**2 / 2.0, dt],
        ]
    )
    moved: Array = F @ P @ F.T + Q
    return F @ state, moved


def _updated(state: Array, P: Array, axis: int, innovation: Array, variance: float) -> tuple[Array, Array]:
    gain = P[:, axis] / (P[axis, axis] + variance)
    narrowed = P - np.outer(gain, P[axis])
    return state + np.outer(gain, innovation), 0.5 * (narrowed + narrowed.T)
