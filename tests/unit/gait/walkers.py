"""Feet that walk in place, by formula: what the gait's tests feed it with."""

from __future__ import annotations

import math

from foottrack_service.gait.samples import FootSample, HeadSample, Shoe, Wearer

ANKLE = 0.09
SHOE = Shoe(ankle_height=ANKLE, toe_ahead=0.19, toe_below=0.07)
WEARER = Wearer(height=1.75, leg=0.86, hip_width=0.18, left=SHOE, right=SHOE)
IDENTITY = (0.0, 0.0, 0.0, 1.0)
HZ = 200


class Foot:
    """Lifts to ``peak`` (m) in swings that begin at given instants and last ``swing`` s; level, on the spot.

    ``shift`` moves it forward by so many m in each swing, ``turn`` to the left by so many rad.
    """

    def __init__(self, x, begins, swing, peak, shift=0.0, turn=0.0):
        self.x, self.begins, self.swing, self.shift = x, list(begins), swing, shift
        self.turns, self.peaks = [turn] * len(self.begins), [peak] * len(self.begins)

    def height(self, t):
        share = self._share(t)
        return self._peak(t) * math.sin(math.pi * share) ** 2

    def sample(self, t):
        share, done = self._share(t), sum(begin + self.swing <= t for begin in self.begins)
        eased = share - math.sin(2 * math.pi * share) / (2 * math.pi)
        way = self.shift * (done + eased)
        yaw = sum(self.turns[:done]) + (eased * self.turns[done] if eased and done < len(self.turns) else 0.0)
        flying = 0.0 < share < 1.0
        vy = self._peak(t) * math.pi / self.swing * math.sin(2 * math.pi * share)
        ahead = self.shift / self.swing * (1 - math.cos(2 * math.pi * share)) if flying else 0.0
        q = (0.0, math.sin(yaw / 2), 0.0, math.cos(yaw / 2))
        v = (0.0, vy if flying else 0.0, -ahead)
        return FootSample((self.x, ANKLE + self.height(t), -way), q, v, not flying)

    def _peak(self, t):
        started = sum(begin < t for begin in self.begins)
        return self.peaks[max(started, 1) - 1] if self.peaks else 0.0

    def _share(self, t):
        for begin in self.begins:
            if begin < t < begin + self.swing:
                return (t - begin) / self.swing
        return 0.0


def marching(cadence, peak, seconds, begin=1.0, swing_share=0.38, **motion):
    """Both feet, by turns."""
    step = 1.0 / cadence
    begins = []
    while begin + step < seconds:
        begins.append(begin)
        begin += step
    swing = swing_share * 2 * step
    return Foot(-0.1, begins[::2], swing, peak, **motion), Foot(0.1, begins[1::2], swing, peak, **motion)


def feed(gait, left, right, seconds, head=None, begin=0.0):
    """[(t s, outputs)] of a gait that sees these feet (None: a foot that is unknown)."""
    outs = []
    for k in range(round(begin * HZ), round(seconds * HZ)):
        t = k / HZ
        feet = [None if foot is None else foot.sample(t) for foot in (left, right)]
        outs.append((t, gait.update(round(t * 1e9), *feet, None if head is None else head(t), 0.0)))
    return outs


def bobbing(hz, size, until=1e9):
    """A head that goes up and down from second 1 on."""

    def head(t):
        y = 1.65 + (0.5 * size * math.sin(2 * math.pi * hz * (t - 1.0)) if 1.0 < t < until else 0.0)
        return HeadSample((0.0, y, 0.0), IDENTITY)

    return head


def events(outs, *names):
    """[(t s, name, side)] of these names, or of all."""
    return [
        (at * 1e-9, event.event, event.side)
        for _, out in outs
        for at, event in out.events
        if not names or event.event in names
    ]
