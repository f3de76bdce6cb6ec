"""What an animation of the avatar's legs is given and what it gives: one interface for ours and for its rivals."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from foottrack_service.gait.steps import Feet, Steps


class LegTarget(NamedTuple):
    """One foot of the avatar. +z is forward here, as in [Z]; on the wire forward is -Z."""

    z: float
    """m before the hips."""
    y: float
    """Ankle above its standing height, m."""
    pitch: float
    """rad, toes up."""


class LegTargets(NamedTuple):
    """Both feet and the pelvis."""

    left: LegTarget
    right: LegTarget
    pelvis_dy: float
    """m, at most 0."""
    speed: float
    """Of the avatar, m/s."""
    walking: bool


class Legs(Protocol):
    """Moves the avatar's legs."""

    def update(self, t: int, dt: float, feet: Feet, steps: Steps) -> LegTargets:
        """Targets at ``t`` ns, ``dt`` s after the last; both feet's phases are up to date."""


def pelvis_drop(leg: float, left_z: float, right_z: float) -> float:
    """How far the hips come down for legs of this length (m) to reach their feet: [Z]'s eq. 5 with the larger |z|."""
    z = min(max(abs(left_z), abs(right_z)), 0.95 * leg)
    return leg - float((leg * leg - z * z) ** 0.5)
