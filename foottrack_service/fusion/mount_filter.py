"""The camera's mount on the headset, estimated in use: a standing foot stays where it is while the head moves.

A correction of the mount (a small turn and a shift, p' = exp(f) p + t), the points of the two standing targets and
whatever else makes them seem to move is one state (mount_kernel): scale of the depth, rest of the lens, slow wander of
the headset. So what is announced knows that these are the same in thousands of pictures. The pictures' noise is learned
from how far, and how alike, they are off.
"""

from __future__ import annotations

import math

import numpy as np

from foottrack_protocol.messages import MountValues, Side
from foottrack_service import rotations as rot
from foottrack_service.config import Placement
from foottrack_service.fusion.interface import OpticalFix
from foottrack_service.fusion.mount_kernel import (
    LENS,
    NEIGHBOURS,
    POINTS,
    SCALE,
    SHIFT,
    STATES,
    TURN,
    WANDER_PLACE,
    WANDER_TURN,
    begin_point,
    look,
    pass_time,
)
from foottrack_service.rotations import Array

MOST_TURN, MOST_SHIFT = 0.03, 0.02
"""rad, m per axis SD: how wrong mounts are at most."""
DEPTH_SCALE = 0.005
"""SD: a D435's depth is good to 2 % at most at 2 m (data sheet), calibrated units to less."""
LENS_REST = 0.0008
"""rad SD at the picture's edge: half a pixel."""
HEAD_NOISE, HEAD_TURN_NOISE = 0.0002, 0.00035
"""m, rad SD: of each head pose (Niehorster, Li and Lappe 2017)."""
WANDER_M, WANDER_RAD, WANDER_S = 0.0005, 0.0006, 20.0
"""SD, SD, time constant: the head pose's slow wander (likewise)."""
FOOT_SHIFT = 0.0002
"""m/sqrt(s) per axis: a person who stands shifts the feet a little."""
STRAP_TURN, STRAP_SHIFT = math.radians(0.003), 0.00006
"""rad/sqrt(s), m/sqrt(s): a strap gives way by 0.1 deg and 2 mm in 20 minutes."""
WORN_TURN, WORN_SHIFT = math.radians(0.1), 0.002
"""rad, m per axis SD: what taking the headset off and putting it on again does to a mount at most."""
OUTLIER = 16.3
"""Chi-square, 3 degrees of freedom."""
OUTLIERS_OF_A_STEP = 6
"""So many in a row: the foot stands elsewhere, or the stage does."""
LONGEST_HOLE_S = 0.25
"""A foot that was not seen for longer may have stepped."""
NOISE_PICTURES = 200.0
"""Over so many pictures their noise is learned."""
NOISE_AT_FIRST, MOST_NOISE = 2.0, 100.0
"""Times the variance that they claim."""


class MountFilter:
    """Takes fixes of standing feet as the *configured* mount gave them."""

    def __init__(self, camera: Placement, known: MountValues | None = None) -> None:
        """``camera``: the configured mount. ``known``: what an earlier use found."""
        self._camera = camera
        self._camera_p, self._camera_q = np.array(camera.p), rot.normalised(camera.q)
        self._x, self.turn = np.zeros(STATES), rot.IDENTITY.copy()
        sd = np.ones(STATES)
        sd[TURN:SHIFT], sd[SHIFT:SCALE], sd[SCALE] = MOST_TURN, MOST_SHIFT, DEPTH_SCALE
        sd[LENS:WANDER_TURN], sd[WANDER_TURN:WANDER_PLACE], sd[WANDER_PLACE:POINTS] = LENS_REST, WANDER_RAD, WANDER_M
        if known is not None:
            sd[TURN:SHIFT] = math.hypot(known.sigma_q, WORN_TURN)
            sd[SHIFT:SCALE] = math.hypot(known.sigma_p, WORN_SHIFT)
            self._x[SHIFT:SCALE], self.turn = known.p, rot.normalised(known.q)
        self._P = np.diag(np.square(sd))
        self._walk = np.zeros(STATES)
        self._walk[TURN:SHIFT], self._walk[SHIFT:SCALE] = STRAP_TURN**2, STRAP_SHIFT**2
        self._walk[POINTS:] = FOOT_SHIFT**2
        self._t: int | None = None
        self._seen_at: dict[Side, int | None] = {"left": None, "right": None}
        self._outliers = {"left": 0, "right": 0}
        self._mean = {"left": np.zeros(3), "right": np.zeros(3)}
        self._variance = self._alike = NOISE_AT_FIRST
        self.noise = NOISE_AT_FIRST
        self.pictures = 0
        self._seen = np.zeros(3)

    def anew(self) -> MountFilter:
        """One that knows nothing yet, and begins where this one is: nearer to the truth than nothing, mostly."""
        new = MountFilter(self._camera)
        new.turn, new._x[SHIFT:WANDER_TURN] = self.turn.copy(), self._x[SHIFT:WANDER_TURN]
        return new

    def widen(self, turn: float, shift: float) -> None:
        """It may be wrong by so much more, rad and m per axis."""
        self._P[range(SHIFT), range(SHIFT)] += turn**2
        self._P[range(SHIFT, SCALE), range(SHIFT, SCALE)] += shift**2

    def add(self, side: Side, fix: OpticalFix) -> None:
        """A fix of a foot that stands."""
        self._pass_time(fix.t)
        seen_at, mean = self._seen_at[side], self._mean[side]
        point = POINTS if side == "left" else POINTS + 3
        on = seen_at is not None and abs(fix.t - seen_at) * 1e-9 <= LONGEST_HOLE_S
        if not on or self._outliers[side] >= OUTLIERS_OF_A_STEP:
            begin_point(self._x, self.turn, self._P, point, fix.head.p, fix.head.q, fix.p)
            mean[:] = 0.0
            self._outliers[side] = 0
        self._seen_at[side] = fix.t
        head = self.noise * (HEAD_NOISE**2 + HEAD_TURN_NOISE**2 * float(fix.p @ fix.p))
        state = (self._x, self.turn, self._P, point, self._camera_p, self._camera_q)
        seen = (fix.head.p, fix.head.q, fix.p, self.noise * fix.cov, head)
        off, alike = look(*state, *seen, OUTLIER, mean)
        if not off <= OUTLIER:
            self._outliers[side] += 1
            return
        self._outliers[side] = 0
        self.pictures += 1
        self._seen += (fix.p - self._seen) / self.pictures
        self._learn_noise(off / 3.0, alike / 3.0)

    def end(self, side: Side) -> None:
        """The foot no longer stands."""
        self._seen_at[side] = None

    @property
    def shift(self) -> Array:
        """m, shape (3,)."""
        return self._x[SHIFT:SCALE].copy()

    @property
    def covariance(self) -> Array:
        """Of turn (rad) and shift (m), shape (6, 6)."""
        # Pictures that are noisier than they claim are so for longer than a running mean shows: feet on soft soles.
        # Measured on those: errors 1.4 to 2.1 times what the state's own covariance says, at noises of 11 to 16.
        return self._P[:SCALE, :SCALE] * math.sqrt(max(1.0, self.noise / NOISE_AT_FIRST))

    @property
    def foot_covariance(self) -> Array:
        """Of what the correction does where the feet were seen, m^2, shape (3, 3)."""
        x, y, z = rot.rotate(self.turn, self._seen).tolist()
        effect = np.hstack([-np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.eye(3)])
        return np.asarray(effect @ self.covariance @ effect.T)

    @property
    def foot_moved(self) -> Array:
        """How the correction moves what is seen where the feet were, m, head frame, shape (3,)."""
        moved: Array = rot.rotate(self.turn, self._seen) + self.shift - self._seen
        return moved

    def _pass_time(self, t: int) -> None:
        dt = 0.0 if self._t is None else (t - self._t) * 1e-9
        if self._t is None or dt > 0.0 or dt < -LONGEST_HOLE_S:
            self._t = t  # of two feet's pictures the older one may come last; a clock may jump back
        dt = max(dt, 0.0)
        kept = math.exp(-dt / WANDER_S)
        walks = dt * self._walk
        walks[WANDER_TURN:WANDER_PLACE] = WANDER_RAD**2 * (1.0 - kept * kept)
        walks[WANDER_PLACE:POINTS] = WANDER_M**2 * (1.0 - kept * kept)
        pass_time(self._x, self._P, kept, walks)

    def _learn_noise(self, squares: float, alike: float) -> None:
        # Neighbours that are off alike say the same twice: their mean is off by more than white noise leaves of it.
        share = 1.0 / NOISE_PICTURES
        self._variance += share * (squares * self.noise - self._variance)
        self._alike += share * (alike * (2.0 - NEIGHBOURS) / NEIGHBOURS * self.noise - self._alike)
        self.noise = min(max(self._variance, self._alike, 1.0), MOST_NOISE)
