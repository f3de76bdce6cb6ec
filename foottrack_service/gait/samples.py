"""What goes into the gait and what comes out: plain tuples of floats, in the wire's frames and units."""

from __future__ import annotations

from typing import NamedTuple

from foottrack_protocol.messages import GaitEvent, GaitState, IkTargets

Vec = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class FootSample(NamedTuple):
    """A fused foot at one instant, stage frame."""

    p: Vec
    """Ankle, m."""
    q: Quat
    """Foot to stage."""
    v: Vec
    """Ankle velocity, m/s."""
    contact: bool
    """Some part of it stands."""


class HeadSample(NamedTuple):
    """The head at one instant, stage frame."""

    p: Vec
    q: Quat


class Shoe(NamedTuple):
    """Where a sole is, in the foot's frame (origin at the ankle), m."""

    ankle_height: float
    toe_ahead: float
    """The toes' tip: ahead of the ankle, positive."""
    toe_below: float
    """The toes' tip: below the ankle, positive."""


class Wearer(NamedTuple):
    """The person's measures, m."""

    height: float
    leg: float
    """Hip to ankle, stretched."""
    hip_width: float
    """Between the hip joints."""
    left: Shoe
    right: Shoe


class GaitOutputs(NamedTuple):
    """What one update brings."""

    state: GaitState
    ik: IkTargets
    events: tuple[tuple[int, GaitEvent], ...]
    """With the instant at which each happened, ns."""
