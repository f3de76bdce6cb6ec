"""The phases of one foot, and the instants at which they change.

Rates rule, places follow: the heel's and the lowest point's rise since the stance are integrated from velocities, so a
correction of the foot's position by a picture is no movement. Thresholds are in metres and seconds and follow the
person. Instants are interpolated between samples, and onsets extrapolated back to where the movement began.
"""

from __future__ import annotations

import math
from typing import Literal

from foottrack_service.body.skeleton import BALL_SHARE
from foottrack_service.gait.samples import FootSample, Shoe

FootEventName = Literal["heel_off", "toe_off", "mid_swing", "terminal_swing", "foot_strike"]
Phase = Literal["stance", "ascending", "mid_swing", "descending", "terminal_swing"]

_HEEL_BEHIND = 0.055
"""m: the heel behind the ankle, about a quarter of a foot."""
_HEEL_RISE = 0.008
_TOE_RISE = 0.009
"""m: what heel and lowest point have risen by when they are taken to have left."""
_SLIDE, _SLIDE_SPEED = 0.05, 0.5
"""m, m/s: toes that have gone so far over the floor, so fast, have left it."""
_STRIDE = 0.12
"""m: toes that have gone so far over the floor make a step, however low."""
_ONSET_SPEED = 0.05
"""m/s, upwards: slower is no lift."""
_SMOOTH, _LOW_POINT = 1.6, 2.2
"""How movements begin: the heel's rise between a line and a parabola, the toes', which roll off, smoother."""
_LIFT_SPEED = 0.12
"""m/s, upwards, of the lowest point: a sole that rolls over its toes seems to rise more slowly."""
_LONGEST_ONSET_S = 0.2
_LEAST_STEP, _MOST_STEP = 0.018, 0.04
"""m: a foot that has risen by so much steps; in between by the person's own peaks."""
_STEP_SHARE = 0.25
_LANDING_SHARE = 0.3
_LEAST_LANDING = 0.02
"""m."""
_DESCENT_SPEED = 0.1
"""m/s: the top of the swing ends with this."""
_FALL_SPEED = 0.12
"""m/s: a foot that never fell so fast has not landed by stopping."""
_LANDED_SHARE = 0.12
"""Of the fall's largest speed: who is slower has landed."""
_STRIDE_SPEED, _BRAKED_SHARE = 0.6, 0.55
"""m/s: a foot that flew ahead so fast has not landed before it has slowed down to this share."""
_TOES_UP, _SLAP = 0.15, 0.02
"""rad: a foot that pointed up so far and has turned down by so much stands on its heel."""
_CLEAR_SHARE = 0.6
"""Of the swing's clearance: a foot that is still so high has not landed."""
_LEAST_SWING_NS = 120_000_000
_LEAST_STANCE_NS = 60_000_000
_LONGEST_SETTLING_NS = 300_000_000
"""A foot that has landed and whose zero velocity is not seen for so long may leave again. A landing that clips the
accelerometer leaves a speed that only the stance takes away."""
_HOLE_S = 0.3
"""Without samples for so long, the foot starts again in stance."""
_QUIET_SPEED = 0.05
"""m/s: slower is flat."""
_PLACE_RATE = 8.0
"""1/s: how fast the integrated height follows the measured one in swing."""
_FLAT_S = 0.05
_HEEL_UP_S = 3.0
"""s: how fast what was integrated is forgotten, standing flat and with the heel up."""
_STANDING_S = 0.4
_TILT_S = 0.008
_PEAK_MEMORY = 0.3


class FootPhases:
    """Feed ``update`` with a foot's samples; read the phase, the height and the new events."""

    def __init__(self, shoe: Shoe) -> None:
        self._shoe = shoe
        # The forefoot rolls over an arc that leaves the flat sole at the ball and ends at the toes' tip.
        rise, run = shoe.ankle_height - shoe.toe_below, (1.0 - BALL_SHARE) * shoe.toe_ahead
        self._radius = 0.5 * (rise * rise + run * run) / rise if rise > 0.0 else 0.0
        self._steepest = run / self._radius if rise > 0.0 else 0.0
        """Sine of the pitch from which on the foot stands on the tip; 0 for a sole without toe spring."""
        self.peak = 0.0
        """Running mean of the peaks of swings, m; 0 before the first."""
        self.swing_s = 0.0
        """The last swing's duration."""
        self.stance_s = 0.0
        """Running mean of stances between steps; 0 before the first."""
        self.events: list[tuple[int, FootEventName]] = []
        """Of the last update, in the order in which they happened."""
        self.reset()

    def reset(self) -> None:
        """Back to stance, knowing nothing of where it is."""
        self.phase: Phase = "stance"
        self.height = self.vy = self.pitch = 0.0
        self.lift = 0.0
        """Rise of the lowest point since the stance, m."""
        self.toe_off_ns: int | None = None
        self.strike_ns: int | None = None
        self.apex = 0.0
        """Highest of this swing so far, m."""
        self.start_height = 0.0
        """Where this swing was noticed, m."""
        self._t: int | None = None
        self._floor: float | None = None
        self._level = 0.0
        self._heel = self._heel_rel = self._low_rel = 0.0
        self._heel_speed = self._low_speed = self._fall = 0.0
        self._stride_speed = self._clear = 0.0
        self._toes_up, self._stopped, self._low = -1.0, False, False
        self._lowest = 0.0
        self._settled = True
        self._slides = False
        self._tip = self._slide = (0.0, 0.0)
        self._heel_off_ns: int | None = None
        self._off_ns: int | None = None
        self.ankle_y: float | None = None
        """Where the ankle was last, stage, m."""
        self.events = []

    @property
    def standing(self) -> bool:
        """Whether the foot is in stance with its heel down, as far as can be told."""
        return self.phase == "stance" and self._heel_off_ns is None

    def update(self, t: int, foot: FootSample) -> None:
        """Take a sample at ``t`` ns."""
        if self.events:
            self.events = []
        last, vy_before = self._t, self.vy
        dt = _HOLE_S if last is None else (t - last) * 1e-9
        if dt <= 0.0:
            return
        self.ankle_y = foot.p[1]
        x, y, z, w = foot.q
        along, up = 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + z * z)
        # The toes' tip, from the ankle, over the floor.
        below, ahead = self._shoe.toe_below, self._shoe.toe_ahead
        tip = (
            -2.0 * (x * y - w * z) * below - 2.0 * (x * z + w * y) * ahead,
            -2.0 * (y * z + w * x) * below - (1.0 - 2.0 * (x * x + y * y)) * ahead,
        )
        if dt >= _HOLE_S:
            self.reset()
            self.ankle_y = self._floor = foot.p[1]
            self._level, self._tip = along, tip
            self._t, self.vy = t, foot.v[1]
            return
        self._t, self.vy = t, foot.v[1]
        self.pitch = math.asin(min(max(self._level - along, -1.0), 1.0))
        before, risen = self._low_speed, 0.5 * (vy_before + foot.v[1]) * dt
        heel, low = self._points(along - self._level, up)
        slid = (foot.v[0] * dt + tip[0] - self._tip[0], foot.v[2] * dt + tip[1] - self._tip[1])
        self._tip = tip
        share = dt / (dt + _TILT_S)
        heel_speed = (1.0 - share) * self._heel_speed + share * (self.vy + (heel - self._heel_rel) / dt)
        self._low_speed += share * (self.vy + (low - self._low_rel) / dt - before)
        self._heel_speed, self._heel_rel, self._low_rel = heel_speed, heel, low
        if self.phase == "stance":
            self._stand(t, dt, foot, along, risen, slid)
        else:
            self.height += risen
            self.height += _PLACE_RATE * dt * (foot.p[1] - (self._floor or 0.0) - self.height)
            self.lift = max(0.0, self.height + low)
            self._swing(t, dt, foot, vy_before, before)

    def _points(self, along: float, up: float) -> tuple[float, float]:
        """How far heel and lowest point are above where they are, below the ankle, of a level foot, m."""
        shoe, radius, steepest = self._shoe, self._radius, self._steepest
        heel = -shoe.ankle_height * up + _HEEL_BEHIND * along
        if 0.0 < along < steepest:
            front = (radius - shoe.ankle_height) * up - BALL_SHARE * shoe.toe_ahead * along - radius
        else:
            ball = -shoe.ankle_height * up - BALL_SHARE * shoe.toe_ahead * along
            front = min(ball, -shoe.toe_below * up - shoe.toe_ahead * along)
        return heel + shoe.ankle_height, min(heel, front) + max(shoe.ankle_height, shoe.toe_below)

    def _stand(
        self, t: int, dt: float, foot: FootSample, along: float, risen: float, slid: tuple[float, float]
    ) -> None:
        vx, vy, vz = foot.v
        quiet = foot.contact and vx * vx + vy * vy + vz * vz < _QUIET_SPEED**2
        keep = 1.0 - min(1.0, dt / (_FLAT_S if quiet else _HEEL_UP_S))
        self.height = (self.height + risen) * keep
        self._heel = self.height + self._heel_rel
        low = self.height + self._low_rel
        self._lowest = min(0.0, low, self._lowest * keep)
        self.lift = low - self._lowest
        if quiet:
            self._slide = (0.0, 0.0)
            share = min(1.0, dt / _STANDING_S)
            self._floor = foot.p[1] if self._floor is None else self._floor + share * (foot.p[1] - self._floor)
            if abs(along - self._level) < 0.2:
                self._level += share * (along - self._level)
        if not self._settled and self.strike_ns is not None:
            self._settled = t - self.strike_ns > (_LEAST_STANCE_NS if foot.contact else _LONGEST_SETTLING_NS)
            self.height *= 1.0 - min(1.0, dt / _FLAT_S)
            self._lowest = self.height + self._low_rel
            self._slide = (0.0, 0.0)
            return
        if self._heel_off_ns is None:
            if self._heel > _HEEL_RISE and self._heel_speed > _ONSET_SPEED:
                self._heel_off_ns = _onset(t, self._heel, self._heel_speed)
        elif self._heel < 0.4 * _HEEL_RISE:
            self._heel_off_ns = None
        if self._off_ns is None:
            if self.lift > _TOE_RISE and self._low_speed > _LIFT_SPEED:
                self._off_ns = _onset(t, self.lift, self._low_speed, _LOW_POINT)
        elif self.lift < 0.6 * _TOE_RISE and not self._slides:
            self._off_ns = None
        self._slip(t, dt, slid)
        if self._off_ns is not None and (self.height > self.step_height or math.hypot(*self._slide) > _STRIDE):
            self._leave(self._off_ns)

    def _slip(self, t: int, dt: float, slid: tuple[float, float]) -> None:
        """A foot that swings low drags its toes along: they have left, though they hardly rise."""
        self._slide = (self._slide[0] + slid[0], self._slide[1] + slid[1])
        gone = math.hypot(*self._slide)
        speed = math.hypot(*slid) / dt
        if self._off_ns is None and gone > _SLIDE and speed > _SLIDE_SPEED:
            self._slides = True
            self._off_ns = _onset(t, gone, speed)

    @property
    def step_height(self) -> float:
        """A foot that has risen by so much steps, m."""
        return min(max(_STEP_SHARE * self.peak, _LEAST_STEP), _MOST_STEP)

    def _leave(self, off: int) -> None:
        off = off if self.strike_ns is None else max(off, self.strike_ns)
        heel_off = off if self._heel_off_ns is None else min(self._heel_off_ns, off)
        if self.strike_ns is not None:
            stance = (off - self.strike_ns) * 1e-9
            if stance < 2.0:
                self.stance_s += (stance - self.stance_s) * (_PEAK_MEMORY if self.stance_s else 1.0)
        self.toe_off_ns, self.start_height, self.apex, self._fall = off, self.height, self.height, 0.0
        self._stride_speed = self._clear = 0.0
        self._toes_up, self._stopped, self._low = -1.0, False, self.height < self.step_height
        self.phase = "ascending"
        self.events += [(heel_off, "heel_off"), (off, "toe_off")]

    def _swing(self, t: int, dt: float, foot: FootSample, vy_before: float, low_before: float) -> None:
        height, vy = self.height, self.vy
        self.apex = max(self.apex, height)
        if self.phase == "ascending":
            if vy > 0.0:
                return
            top = t - round(dt * 1e9 * -vy / max(vy_before - vy, 1e-9)) if vy_before > 0.0 else t
            self.phase = "mid_swing"
            self.events.append((top, "mid_swing"))
        if self.phase == "mid_swing" and vy < -_DESCENT_SPEED:
            self.phase = "descending"
        landing = max(_LANDING_SHARE * self.apex, _LEAST_LANDING)
        if self.phase == "descending" and height < landing:
            self.phase = "terminal_swing"
            self.events.append(
                (t - round(dt * 1e9 * min(1.0, (landing - height) / max(-vy * dt, 1e-6))), "terminal_swing")
            )
        self._fall = max(self._fall, -self._low_speed)
        if self.toe_off_ns is not None and t - self.toe_off_ns < _LEAST_SWING_NS:
            return
        ahead = math.hypot(foot.v[0], foot.v[2])
        self._stride_speed = max(self._stride_speed, ahead)
        self._clear = max(self._clear, self.lift)
        stopped = self._fall > _FALL_SPEED and -self._low_speed < max(_LANDED_SHARE * self._fall, 0.06)
        if self._stride_speed > _STRIDE_SPEED:
            # An impact that clips the accelerometer leaves a wrong speed: that it had stopped falling is remembered,
            # and that toes which pointed up come down.
            self._toes_up = max(self._toes_up, self.pitch)
            slaps = self._toes_up > _TOES_UP and self.pitch < self._toes_up - _SLAP
            self._stopped = stopped = stopped or slaps or self._stopped
            down = ahead < _BRAKED_SHARE * self._stride_speed
        else:
            down = self.lift < _CLEAR_SHARE * self._clear
        if down and stopped and (height < 0.6 * self.apex or self._low):
            self._land(t, dt, low_before)
        elif foot.contact and height < 0.7 * self.apex and abs(vy) < _QUIET_SPEED:
            self._land(t, dt, 0.0)

    def _land(self, t: int, dt: float, low_before: float) -> None:
        slowing = (self._low_speed - low_before) / dt
        left = -self._low_speed / slowing if low_before < 0.0 and slowing > 1.0 else 0.0
        strike = t + round(1e9 * min(max(left, -dt), 0.0))
        if self.phase != "terminal_swing":
            self.events.append((min(strike, t), "terminal_swing"))
        self.events.append((strike, "foot_strike"))
        if self.toe_off_ns is not None:
            self.swing_s = (strike - self.toe_off_ns) * 1e-9
        self.peak += (self.apex - self.peak) * (_PEAK_MEMORY if self.peak else 1.0)
        self.phase, self.strike_ns = "stance", strike
        self._heel = self.lift = self._lowest = 0.0
        self._heel_off_ns = self._off_ns = None
        self._settled = self._slides = False
        self._slide = (0.0, 0.0)


def _onset(t: int, risen: float, speed: float, power: float = _SMOOTH) -> int:
    """When a rise by ``risen`` m, going on with this speed, m/s, began: it went like time to the ``power``."""
    return t - round(1e9 * min(power * risen / speed, _LONGEST_ONSET_S))
