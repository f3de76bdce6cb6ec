"""Measures of the simulated person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from foottrack_service.config import BodySettings, FootSettings
from foottrack_service.rotations import Array

# Segment lengths as shares of the standing height: Drillis and Contini 1966, in D. Winter, Biomechanics and Motor
# Control of Human Movement, fig. 4.1.
_THIGH, _SHANK, _EYE = 0.245, 0.246, 0.936
_HIP_SPACING = 0.10  # distance of the hip joints' centres: Winter's hip breadth (0.191) less the flesh outside them
_STANDING_SHARE = 0.993  # hip to ankle over thigh plus shank at ease: the knees bend by some 13 deg
_HEEL_BEHIND_ANKLE = 0.055  # m, about a quarter of a foot of 0.26 m
_BALL_SHARE = 0.65  # the metatarsal heads lie at about 0.65 to 0.7 of the way from ankle to toes

EYES_FROM_NECK = np.array([0.0, 0.12, -0.09])
"""Eyes (the headset's origin) from the neck's pivot, m, head frame."""


@dataclass(frozen=True)
class Person:
    """Lengths, m."""

    thigh: float
    shank: float
    hip_spacing: float
    hip_height: float
    """Standing, above the floor."""
    neck_above_hips: float

    @property
    def leg(self) -> float:
        """Hip to ankle, stretched."""
        return self.thigh + self.shank


@dataclass(frozen=True)
class Sole:
    """Where a shoe touches the floor, foot frame (origin at the ankle)."""

    ankle_height: float
    heel_z: float
    """m behind the ankle, positive."""
    ball_z: float
    """m ahead of the ankle, positive."""
    toe_z: float
    """m ahead of the ankle, positive: the toes' tip."""
    toe_height: float
    """m from the toes' tip up to the ankle."""

    @property
    def heel(self) -> Array:
        """(3,) m."""
        return np.array([0.0, -self.ankle_height, self.heel_z])

    @property
    def ball(self) -> Array:
        """(3,) m."""
        return np.array([0.0, -self.ankle_height, -self.ball_z])


def person(body: BodySettings, ankle_height: float) -> Person:
    """The person of these settings; what they leave out is scaled from the height."""
    thigh = body.thigh or _THIGH * body.height
    shank = body.shank or _SHANK * body.height
    hip_height = ankle_height + _STANDING_SHARE * (thigh + shank)
    neck = _EYE * body.height - float(EYES_FROM_NECK[1])
    spacing = body.hip_width or _HIP_SPACING * body.height
    return Person(thigh, shank, spacing, hip_height, neck - hip_height)


def sole(foot: FootSettings) -> Sole:
    """The sole of one shoe."""
    toe_z = -foot.toe.p[2]
    return Sole(foot.ankle_height, _HEEL_BEHIND_ANKLE, _BALL_SHARE * toe_z, toe_z, -foot.toe.p[1])


def knees(hip: Array, ankle: Array, forward: Array, person: Person) -> Array:
    """Knees (n, 3) of two-bone legs from `hip` to `ankle` (n, 3) m, bending towards `forward` (n, 3) unit."""
    axis = ankle - hip
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    axis = axis / length
    span = np.minimum(length, person.leg * (1.0 - 1e-9))
    along = (person.thigh**2 - person.shank**2 + span**2) / (2.0 * span)
    pole = forward - axis * np.sum(forward * axis, axis=-1, keepdims=True)
    pole = pole / np.linalg.norm(pole, axis=-1, keepdims=True)
    bend: Array = np.sqrt(np.maximum(person.thigh**2 - along**2, 0.0))
    return np.asarray(hip + along * axis + bend * pole)
