"""Both feet together: what is a step, whether the person walks in place, how fast, and when it ends."""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple

from foottrack_protocol.messages import Side
from foottrack_service.gait.foot_phases import FootPhases
from foottrack_service.gait.samples import FootSample
from foottrack_service.gait.speed import SpeedModel

Event = tuple[int, str, Side | None, int]
"""Instant ns, name, side, number of the step."""

_TOGETHER_S = 0.1
"""Feet that leave the floor within this jump."""
_START_SPEED, _START_WAY, _START_TURN = 0.9, 0.07, 0.17
"""m/s, m and rad at the apex of a first step: more, and it goes somewhere or turns."""
_UNSURE_TURN = 0.07
"""rad: what has turned so far at the top waits for its end, when twice as much is known."""
_FIRST_WAY, _FIRST_TURN = 0.15, 0.28
"""m, rad: more at its end, and the first step was none in place after all."""
_LITTLE_TURN, _SECOND_TURN = 0.42, 0.2
"""rad: up to the first at its end, it may be that somebody walks in place and turns. One who turns on the spot has with
the next step turned by more than the second at its top."""
_TURNING_S, _LAST_TURN = 1.5, 0.2
"""Whoever turned with a step so short a while ago, does so until a step turns by less than this, rad."""
_WALK_SPEED, _WALK_WAY = 0.8, 0.28
"""m/s and m of a step in the midst of walking in place: more, and the person really walks."""
_LEAST_INTERVAL_S, _LONGEST_INTERVAL_S = 0.2, 2.0
_UNEVEN = 1.35
"""Times the one before: an interval that differs by more shows another pace, not another leg."""
_FIRST_SHARE = 0.8
"""Of a step's duration: its swing. Good for the first step, when no interval is known."""
_STOP_SHARE, _STOP_PLUS_S = 1.5, 0.1
_SOONEST_STOP_S, _LATEST_STOP_S = 0.25, 0.6
_SLOW_SHARE, _SLOW_PLUS_S = 1.15, 0.05
"""Who takes less than a step a second stands longer than that at every step, and does not stop with each (at 0.8
steps/s 0.6 s made 34 walks of 12)."""
_FIRST_STOP_S = 0.7
"""Before three double supports are known."""
_HELD_SHARE, _HELD_S = 2.5, 1.0
"""A foot that is held up for longer than a share of the interval, and this, has stopped as well."""
_OVERDUE = 1.25
"""The cadence falls when the next step is later than this share of the interval."""


class Feet(NamedTuple):
    """Both feet's phases."""

    left: FootPhases
    right: FootPhases


class _Swing:
    """What is known of a foot's swing."""

    __slots__ = ("counted", "first", "jump", "most_turn", "number", "off", "real", "unsure", "x", "yaw", "z")

    def __init__(self, off: int, number: int, foot: FootSample) -> None:
        self.off, self.number = off, number
        self.x, _, self.z = foot.p
        self.yaw, self.most_turn = yaw_of(foot), _FIRST_TURN
        self.counted = self.first = self.jump = self.real = self.unsure = False

    def way(self, foot: FootSample) -> float:
        """Over the floor since the heel left, m."""
        return math.hypot(foot.p[0] - self.x, foot.p[2] - self.z)

    def turned(self, foot: FootSample) -> float:
        """Since then, rad."""
        return abs(_wrapped(yaw_of(foot) - self.yaw))


class Steps:
    """Feed ``update`` after both feet were updated; read whether the person walks in place, cadence and steps."""

    def __init__(self, feet: Feet, model: SpeedModel, most_speed: float) -> None:
        self._feet, self._model, self._most = feet, model, most_speed
        self.walking = False
        """In place: the avatar walks."""
        self.count = 0
        """Steps since the start, in place and real ones."""
        self.step_s = 0.6
        """Duration of a step, as far as is known."""
        self.stopped_ns: int | None = None
        """When the last walk ended."""
        self._swings: dict[Side, _Swing | None] = {"left": None, "right": None}
        self._last: dict[str, tuple[int, ...]] = {}
        self._intervals: deque[float] = deque(maxlen=3)
        self._supports: deque[float] = deque(maxlen=3)
        self._landed: int | None = None
        self._moved: int | None = None
        self._turned: int | None = None
        self._turned_little: int | None = None
        self._t: int | None = None

    def cadence(self, t: int) -> float:
        """steps/s at ``t`` ns; 0 when nobody walks in place."""
        if not self.walking or self._moved is None:
            return 0.0
        waited = (t - self._moved) * 1e-9
        return 1.0 / max(self.step_s, waited / _OVERDUE)

    def speed(self, t: int) -> float:
        """m/s that the model asks for at ``t`` ns."""
        return min(self._model.speed(self.cadence(t)), self._most) if self.walking else 0.0

    def swings_in_place(self, side: Side) -> bool:
        """Whether this foot's swing, if it has one, belongs to walking in place as far as can be told."""
        swing = self._swings[side]
        return self.walking and (swing is None or not (swing.jump or swing.real))

    def update(self, t: int, samples: dict[Side, FootSample | None]) -> list[Event]:
        """What happened since the last update."""
        dt = 0.0 if self._t is None else (t - self._t) * 1e-9
        self._t = t
        left, right = self._feet
        self._model.update(dt, abs(left.vy) + abs(right.vy))
        events: list[Event] = []
        pair: tuple[tuple[Side, FootPhases], tuple[Side, FootPhases]] = (("left", left), ("right", right))
        for side, phases in pair:
            foot = samples[side]
            if foot is None:
                self._swings[side] = None
                continue
            for at, name in phases.events:
                self._on_event(side, phases, foot, at, name, events)
            swing = self._swings[side]
            if swing is not None and self.walking and swing.counted and not swing.real and self._goes(swing, foot):
                self._really_walks(swing, events)
        self._watch_for_the_end(t, events)
        return events

    def _on_event(
        self, side: Side, phases: FootPhases, foot: FootSample, at: int, name: str, events: list[Event]
    ) -> None:
        other = self._swings["right" if side == "left" else "left"]
        if name == "heel_off":
            pending = other is not None and not other.counted and not other.jump
            self._swings[side] = _Swing(at, self.count + (2 if pending else 1), foot)
        current = self._swings[side]
        if name == "toe_off" and current is not None:
            current.off = at
            if other is not None and not other.counted and (at - other.off) * 1e-9 < _TOGETHER_S:
                current.jump = other.jump = True
            if self._landed is not None:
                self._supports.append(max(0.0, (at - self._landed) * 1e-9))
        number = self.count + 1 if current is None else current.number
        events.append((at, name, side, number))
        if name == "mid_swing" and current is not None and not current.jump:
            self._judge(current, foot, at, events)
        if name != "heel_off" and current is not None and not current.jump:
            self._moved = max(at, self._moved or at)
            self._interval(name, at)
            mean = phases.apex / max((at - current.off) * 1e-9, 0.05)
            self._model.event(name, 1.0 / self.step_s, phases.apex, mean)
        if name == "foot_strike":
            if current is not None and current.counted and not self.walking:
                self._judge_late(current, foot, at, events)
            self._swings[side] = None
            self._landed = at

    def _judge(self, swing: _Swing, foot: FootSample, at: int, events: list[Event]) -> None:
        self.count = max(self.count + 1, swing.number)
        swing.number, swing.counted = self.count, True
        if self.walking:
            return
        turned, second = swing.turned(foot), _recent(self._turned_little, at)
        self._turned_little = None
        goes = math.hypot(foot.v[0], foot.v[2]) > _START_SPEED or swing.way(foot) > _START_WAY
        if goes or turned > (_SECOND_TURN if second else _START_TURN):
            swing.real = True
        elif not second and (turned > _UNSURE_TURN or _recent(self._turned, at)):
            swing.unsure = True
        else:
            swing.most_turn = _LITTLE_TURN if second else _FIRST_TURN
            self._begin(swing, 2.0 * (at - swing.off) * 1e-9, events)

    def _judge_late(self, swing: _Swing, foot: FootSample, at: int, events: list[Event]) -> None:
        """At the end of a step that did not begin a walk at its top."""
        turned, turning = swing.turned(foot), _recent(self._turned, at)
        here = swing.unsure and swing.way(foot) < _FIRST_WAY
        if here and turned < (_LAST_TURN if turning else _FIRST_TURN):
            self._begin(swing, (at - swing.off) * 1e-9, events)
        elif here and not turning and turned < _LITTLE_TURN:
            self._turned_little = at
        elif turned > _LAST_TURN:
            self._turned = at

    def _begin(self, swing: _Swing, swing_s: float, events: list[Event]) -> None:
        self.walking, self.stopped_ns, swing.first = True, None, True
        self._intervals.clear()
        self._last = {"toe_off": (swing.off,)}
        self.step_s = min(max(swing_s / _FIRST_SHARE, 0.4), 1.2)
        events.append((swing.off, "first_step", None, swing.number))

    def _interval(self, name: str, at: int) -> None:
        last = self._last.get(name, ())
        self._last[name] = (*last[-1:], at)
        if not last or not self.walking:
            return
        interval = (at - last[-1]) * 1e-9
        if _LEAST_INTERVAL_S < interval < _LONGEST_INTERVAL_S:
            # Left and right differ: two even steps make a stride, which has a pace.
            before = (last[-1] - last[0]) * 1e-9
            even = interval < _UNEVEN * before and before < _UNEVEN * interval
            self._intervals.append(0.5 * (before + interval) if even else interval)
            self.step_s = median(self._intervals)

    def _goes(self, swing: _Swing, foot: FootSample) -> bool:
        ahead, way = math.hypot(foot.v[0], foot.v[2]), swing.way(foot)
        if swing.first and swing.turned(foot) > swing.most_turn:
            return True
        return way > (_FIRST_WAY if swing.first else _WALK_WAY) or (ahead > _WALK_SPEED and way > 0.5 * _WALK_WAY)

    def _really_walks(self, swing: _Swing, events: list[Event]) -> None:
        swing.real = True
        self._end(swing.off, events)

    def _watch_for_the_end(self, t: int, events: list[Event]) -> None:
        if not self.walking or self._moved is None:
            return
        waited = (t - self._moved) * 1e-9
        left, right = self._feet
        if left.standing and right.standing and self._landed is not None:
            limit = _FIRST_STOP_S
            if len(self._supports) == self._supports.maxlen:
                usual = median(self._supports)
                latest = max(_LATEST_STOP_S, _SLOW_SHARE * usual + _SLOW_PLUS_S)
                limit = min(max(_STOP_SHARE * usual + _STOP_PLUS_S, _SOONEST_STOP_S), latest)
            if (t - self._landed) * 1e-9 > limit:
                self._end(self._landed, events)
        elif waited > max(_HELD_S, _HELD_SHARE * self.step_s):
            self._end(self._moved, events)

    def _end(self, at: int, events: list[Event]) -> None:
        self.walking, self.stopped_ns = False, at
        self._model.stop()
        events.append((at, "stop", None, self.count))


def _recent(then: int | None, t: int) -> bool:
    return then is not None and (t - then) * 1e-9 < _TURNING_S


def yaw_of(foot: FootSample) -> float:
    """Heading of the toes, rad, positive to the left."""
    x, y, z, w = foot.q
    return math.atan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
