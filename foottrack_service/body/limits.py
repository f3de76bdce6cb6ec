"""Joint limits: how far a bone may turn against the one before it.

A limit is given the direction of the bone before (unit), and the bone's own (unit), and answers with the nearest
direction that is allowed (unit).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from foottrack_service.body.vectors import Vec, along, cross, dot, unit, without


class Limit(Protocol):
    """Of one joint."""

    def __call__(self, before: Vec, bone: Vec) -> Vec:
        """The allowed direction."""

    def alone(self, bone: Vec) -> Vec:
        """The same as far as it can be told without the bone before."""


@dataclass(frozen=True, slots=True)
class Rigid:
    """The bone has one direction: a part of the pelvis, or of the head."""

    direction: Vec

    def __call__(self, before: Vec, bone: Vec) -> Vec:
        """Always the same."""
        return self.direction

    def alone(self, bone: Vec) -> Vec:
        """Always the same."""
        return self.direction


@dataclass(frozen=True, slots=True)
class Cone:
    """A ball joint: rad to the front, the back, the right, the left of ``rest`` (None: of the bone before).

    The quarters of ellipses of Aristidou and Lasenby (2011), drawn in angles and not in a plane, so that a limit may
    be beyond 90 deg. ``front`` and ``right`` are unit axes of the body.
    """

    front: Vec
    right: Vec
    angles: tuple[float, float, float, float]
    rest: Vec | None = None

    def __call__(self, before: Vec, bone: Vec) -> Vec:
        """Turned back onto the cone, the short way."""
        axis = self.rest or before
        cosine = dot(axis, bone)
        out = without(bone, axis)
        sine = math.sqrt(dot(out, out))
        if sine < 1e-9:
            return bone if cosine > 0.0 else self.front
        out = (out[0] / sine, out[1] / sine, out[2] / sine)
        ahead, aside = dot(out, self.front), dot(out, self.right)
        front, back, right, left = self.angles
        x, y = aside / (right if aside > 0.0 else left), ahead / (front if ahead > 0.0 else back)
        across = math.hypot(ahead, aside)
        most = across / math.hypot(x, y) if across > 1e-9 else max(self.angles)
        if math.atan2(sine, cosine) <= most:
            return bone
        return along(_scaled(axis, math.cos(most)), out, math.sin(most))

    def alone(self, bone: Vec) -> Vec:
        """Anything."""
        return bone


@dataclass(frozen=True, slots=True)
class Hinge:
    """A knee: turns about ``axis`` (unit, to the right) only, backwards by at most ``most`` rad and never forwards."""

    axis: Vec
    most: float

    def __call__(self, before: Vec, bone: Vec) -> Vec:
        """Laid into the hinge's plane, then turned back into its range."""
        straight = unit(without(before, self.axis), before)
        back = cross(straight, self.axis)
        flexed = math.atan2(dot(bone, back), dot(bone, straight))
        # Bent too far and bent the wrong way meet at the back: the nearer end counts.
        if flexed < 0.5 * self.most - math.pi:
            flexed = self.most
        flexed = min(max(flexed, 0.0), self.most)
        return along(_scaled(straight, math.cos(flexed)), back, math.sin(flexed))

    def alone(self, bone: Vec) -> Vec:
        """Laid into the hinge's plane."""
        return unit(without(bone, self.axis), bone)


def _scaled(a: Vec, by: float) -> Vec:
    return (a[0] * by, a[1] * by, a[2] * by)
