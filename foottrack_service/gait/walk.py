"""Ours: legs that swing with the user's feet and stand still in the world.

Each swing has a progress q that never falls. On the way up q = (1 - cos(pi/2 u)) / 2 with u the height's share of the
person's usual peak; at the top it is anchored at what was reached; on the way down q = qa + (1 - qa) cos(pi/2 h / ha).
The foot goes from where it was to where the step is planned to end in the measure of q:
dz = (target - z) dq / (1 - q), which is continuous whatever the peak, and whenever the plan changes.
[Z]'s equations 1 to 4 are its special case with peaks of y_max (and without the sine of eq. 3).

A foot that is down moves at minus the avatar's speed, so it stands in the world. A step of S = speed x stance closes
the cycle.
"""

from __future__ import annotations

import math
from typing import Final

from foottrack_service.gait.foot_phases import FootPhases
from foottrack_service.gait.legs import LegTarget, LegTargets, pelvis_drop
from foottrack_service.gait.steps import Feet, Steps

FIRST_PEAK = 0.12
"""m: the peak that is expected before the first."""
LONGEST_STEP = 0.5
"""Of the leg: how far from the hips a step may end."""
LEAVES, FARTHEST = 0.52, 0.62
"""Of the leg: who walks fast runs. The avatar's planted foot leaves the floor from the first on, though the user's
still stands, and goes back no further than the second."""
_REACH = 0.7
"""Of the leg: at no speed, after no hole in the data, does a planted foot go back further."""
_RUNNING_LIFT = 0.03
"""m: how high such a foot is held until the user's follows."""
_LIFT_STIFFNESS, _SETTLE_STIFFNESS = 90.0, 40.0
"""1/s: how tightly it is lifted, and comes back from there."""
_RUNNING_SPEED = 0.3
"""m/s: a slower avatar does not run."""
_LONGEST_S = 0.025
"""A frame that is longer is gone through in parts, or a foot would be carried past where it leaves."""
_DOWN, _UP = 0.004, 0.03
"""m: a foot below the first stands, above the second it flies free; in between it goes along with the ground."""
_LANDING_S = 0.06
_GRIP_S = 0.05
"""s: from flying free to standing, and back, at the soonest."""
_SPEED_S = 0.15
"""s: how fast the avatar's speed follows the model's."""
_LAST_BRAKE = 0.4
"""m/s^2, below 0.02 m/s: an exponential never ends."""
_RETURN_AFTER_S = 1.5
"""s of standing after which the legs come back under the hips [Z]."""
_RETURN_S, _RETURN_PACE = 0.3, 1.0
"""s, s/m: how long that takes, by the way."""
_RETURN_LIFT, _LEAST_LIFT, _LARGEST_LIFT = 0.15, 0.02, 0.05
"""A foot returns in a small step, lifted by a share of its way within these m. It does not slide."""
_NEAR = 0.004
"""m: closer is under the hips."""
_STIFFNESS = 55.0
"""1/s: how tightly a foot in the air follows its goal. Low steps make much way of little height, and of its noise."""
_FOUND_SPEED = 0.3
"""m/s: a foot whose height changes by so much more than its speed explains was not moved, but found elsewhere."""
_HARDEST_LANDING = 100.0
"""m/s^2, upwards: no foot comes to rest on the floor more suddenly."""
_TURN_RATE = 20.0
"""rad/s: no ankle turns faster."""
_HALF_PI: Final = 0.5 * math.pi


class _Leg:
    """One leg of the avatar."""

    __slots__ = (
        "aim",
        "down",
        "extra",
        "extra_rate",
        "fall",
        "goal",
        "height",
        "origin",
        "peak",
        "pitch",
        "progress",
        "rate",
        "rising",
        "share",
        "start",
        "swinging",
        "target",
        "top",
        "vy",
        "y",
        "z",
    )

    def __init__(self) -> None:
        self.z = self.goal = self.rate = self.target = self.height = self.vy = self.pitch = 0.0
        self.aim = 0.0
        """Where the goal was when the foot last went after it, m: it goes on from there evenly, not at once. Frames are
        of uneven length, and what is held or gripped for a whole one would show it."""
        self.extra = self.extra_rate = 0.0
        self.y = 0.0
        """What is shown of the height, m."""
        self.swinging = self.rising = False
        self.progress = self.share = 0.0
        self.start = self.peak = self.top = 0.0
        self.origin = self.fall = 0.0
        self.down = 1.0
        """How much the foot goes along with the ground, 0 to 1."""

    def swing(self, foot: FootPhases, plan: float) -> None:
        """Follow the user's foot; ``plan`` is where a step ends that is planned now, m."""
        height = foot.height
        if not self.swinging:
            self.swinging = self.rising = True
            self.progress, self.target, self.fall = 0.0, plan, 0.0
            self.start = foot.start_height
            self.peak = max(foot.peak or FIRST_PEAK, self.start + 0.02)
        if self.rising and foot.phase != "ascending":
            self.rising, self.share = False, self.progress
            self.top, self.target = max(foot.apex, 0.01), plan
        if self.rising:
            share = _share((height - self.start) / (self.peak - self.start))
            progress = 0.5 * (1.0 - math.cos(_HALF_PI * share))
        else:
            share = _share(height / self.top)
            progress = self.share + (1.0 - self.share) * math.cos(_HALF_PI * share)
        if progress > self.progress:
            left = 1.0 - self.progress
            self.goal += (self.target - self.goal) * ((progress - self.progress) / left if left > 1e-6 else 1.0)
            self.progress = progress

    def measure(self, foot: FootPhases, dt: float) -> None:
        """Take the user's foot. One that was lost, or found elsewhere, does not jump: what it jumped by fades."""
        height = max(0.0, foot.height)
        change, moved, found = height - self.height, 0.5 * (self.vy + foot.vy) * dt, _FOUND_SPEED * dt
        self.extra -= change - min(max(change, min(moved, 0.0) - found), max(moved, 0.0) + found)
        self.height, self.vy = height, foot.vy
        self.pitch += min(max(foot.pitch - self.pitch, -_TURN_RATE * dt), _TURN_RATE * dt)

    def show(self, dt: float) -> LegTarget:
        """The target. A landing that is measured below the floor does not end there at once: the foot brakes before."""
        braked = max(0.0, math.sqrt(self.y) - math.sqrt(0.5 * _HARDEST_LANDING) * dt)
        self.y = max(self.height + self.extra, braked * braked)
        return LegTarget(self.z, self.y, self.pitch)

    def along(self, foot: FootPhases, speed: float, dt: float, leg: float) -> None:
        """Go after the swing's goal, and along with the ground, which moves back at ``speed`` m/s."""
        parts = math.ceil(dt / _LONGEST_S)
        for left in range(parts, 0, -1):
            self._go_along(foot, speed, dt / parts, leg, left)

    def _go_along(self, foot: FootPhases, speed: float, dt: float, leg: float, parts_left: int) -> None:
        runs = _share((-self.z / leg - LEAVES) / (FARTHEST - LEAVES)) * min(1.0, speed / _RUNNING_SPEED)
        wanted = 1.0 - runs
        if foot.phase != "stance":
            # A fast landing is met earlier, or the foot would stop within a frame.
            self.fall = max(self.fall, -foot.vy)
            free = max(_UP, _LANDING_S * self.fall)
            clear = (foot.lift if foot.phase == "ascending" else foot.height) + self.extra
            near = 1.0 - _share((clear - _DOWN) / (free - _DOWN))
            # It leaves the ground once, and comes back to it once.
            wanted = min(wanted, min(near, self.down) if foot.phase == "ascending" else max(near, self.down))
        lift = _RUNNING_LIFT * runs
        stiffness = _LIFT_STIFFNESS if lift > self.extra else _SETTLE_STIFFNESS
        self.extra, self.extra_rate = _sprung(self.extra, self.extra_rate, lift, stiffness, dt)
        change, gripped = dt / _GRIP_S, _smooth(self.down)
        self.down += min(max(wanted - self.down, -change), change)
        # A drifting foot may be measured below the floor, which is no reason to hold it there.
        if max(0.0, foot.height) + self.extra < _DOWN:
            self.down = 1.0
        if self.down >= 1.0:
            self.goal, self.aim, self.rate = self.z, self.z, 0.0
        grip = 0.5 * (gripped + _smooth(self.down))
        moved = (self.goal - self.aim) / parts_left
        z, self.rate = _sprung(self.z, self.rate, self.aim, _STIFFNESS, dt, moved)
        way = min(speed * dt * grip, max(0.0, self.z + _REACH * leg))
        self.z += (z - self.z) * (1.0 - grip) - way
        self.goal -= way
        self.aim += moved - way
        self.target -= way


class WalkingLegs:
    """See the module. ``leg`` is the wearer's, m."""

    def __init__(self, leg: float) -> None:
        self._leg = leg
        self._legs = (_Leg(), _Leg())
        self._speed = 0.0
        self._returning: int | None = None
        self._returned_s = 0.0

    def update(self, t: int, dt: float, feet: Feet, steps: Steps) -> LegTargets:
        """Targets at ``t`` ns."""
        wanted = steps.speed(t)
        self._speed += (wanted - self._speed) * (1.0 - math.exp(-dt / _SPEED_S))
        if wanted == 0.0 and self._speed < 0.02:
            self._speed = max(0.0, self._speed - _LAST_BRAKE * dt)
        speed = self._speed
        for index, (leg, foot) in enumerate(zip(self._legs, feet, strict=True)):
            leg.measure(foot, dt)
            if foot.phase != "stance":
                if self._returning == index:
                    self._returning = None
                leg.swing(foot, self._plan(foot, steps, wanted, index))
            else:
                leg.swinging = False
            leg.along(foot, speed, dt, self._leg)
        self._return(t, dt, feet, steps)
        left, right = (leg.show(dt) for leg in self._legs)
        drop = pelvis_drop(self._leg, left.z, right.z)
        return LegTargets(left, right, -drop, speed, steps.walking or speed > 0.0)

    def _plan(self, foot: FootPhases, steps: Steps, speed: float, index: int) -> float:
        if not steps.swings_in_place("left" if index == 0 else "right"):
            return 0.0
        swing = foot.swing_s or 0.8 * steps.step_s
        stance = max(2.0 * steps.step_s - swing, 0.3 * steps.step_s)
        return min(0.5 * speed * stance, LONGEST_STEP * self._leg)

    def _return(self, t: int, dt: float, feet: Feet, steps: Steps) -> None:
        if steps.walking or self._speed > 0.0 or not (feet.left.standing and feet.right.standing):
            self._returning = None
            return
        if steps.stopped_ns is not None and (t - steps.stopped_ns) * 1e-9 < _RETURN_AFTER_S:
            return
        if self._returning is None:
            farther = 0 if abs(self._legs[0].z) >= abs(self._legs[1].z) else 1
            if abs(self._legs[farther].z) < _NEAR or self._legs[farther].extra > _DOWN:
                return
            self._returning, self._returned_s = farther, 0.0
            self._legs[farther].origin = self._legs[farther].z
        leg = self._legs[self._returning]
        lasts = _RETURN_S + _RETURN_PACE * abs(leg.origin)
        before = _carried(self._returned_s / lasts)
        self._returned_s += dt
        share = min(self._returned_s / lasts, 1.0)
        now = _carried(share)
        leg.z = leg.z * (1.0 - now) / (1.0 - before) if before < 1.0 else 0.0
        lift = min(max(_RETURN_LIFT * abs(leg.origin), _LEAST_LIFT), _LARGEST_LIFT)
        leg.extra = lift * math.sin(math.pi * share) ** 2
        leg.extra_rate = lift * math.pi / lasts * math.sin(2.0 * math.pi * share)
        if share >= 1.0:
            self._returning = None


def _sprung(
    at: float, rate: float, goal: float, stiffness: float, dt: float, moved: float = 0.0
) -> tuple[float, float]:
    """The exact step of a critically damped spring: place and rate after ``dt`` s; ``stiffness`` 1/s.

    Its goal moves meanwhile, evenly, by ``moved``: what follows a goal that moves stays behind by 2 pace / stiffness.
    """
    pace = moved / dt
    follows = goal - 2.0 * pace / stiffness
    gap, fade = at - follows, math.exp(-stiffness * dt)
    pull = (rate - pace + stiffness * gap) * dt
    return follows + moved + (gap + pull) * fade, pace + (rate - pace - stiffness * pull) * fade


def _share(share: float) -> float:
    return min(max(share, 0.0), 1.0)


def _smooth(share: float) -> float:
    s = _share(share)
    return s * s * (3.0 - 2.0 * s)


def _carried(share: float) -> float:
    """How much of its way a returning foot has gone: it is lifted first, and set down last."""
    s = _share((share - 0.2) / 0.6)
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
