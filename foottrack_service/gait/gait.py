"""The gait of one user: fused feet in; phases, events and an avatar's targets out. Reads no clock."""

from __future__ import annotations

import math

from foottrack_protocol.messages import FootGait, GaitEvent, GaitState, IkFoot, IkTargets, Side
from foottrack_service.gait.foot_phases import FootPhases
from foottrack_service.gait.head_bob import HeadBob
from foottrack_service.gait.keyframe import KeyframeLegs
from foottrack_service.gait.legs import Legs, LegTarget, LegTargets
from foottrack_service.gait.reference import ReferenceLegs
from foottrack_service.gait.samples import FootSample, GaitOutputs, HeadSample, Wearer
from foottrack_service.gait.settings import GaitSettings
from foottrack_service.gait.speed import make_model
from foottrack_service.gait.steps import Feet, Steps
from foottrack_service.gait.walk import WalkingLegs

HINT_AHEAD = 0.29
"""m: the knee's hint lies so far before the knee [Z]."""
_ALONE_S = 1.0
"""s without any foot before steps are taken from the head."""
_HOLE_S = 0.3
"""s: after a longer pause no motion is carried over."""


class Gait:
    """Feed ``update`` with what fusion knows, at its rate."""

    def __init__(self, wearer: Wearer, settings: GaitSettings) -> None:
        self._wearer, self._settings = wearer, settings
        self._feet = Feet(FootPhases(wearer.left), FootPhases(wearer.right))
        self._steps = Steps(self._feet, make_model(settings.speed, wearer.height), settings.most_speed)
        self.legs = _make_legs(settings, wearer)
        """What moves the avatar's legs."""
        self._bob = HeadBob(wearer.height)
        self._alone_since: int | None = None
        self._alone = False
        self._t: int | None = None

    def update(
        self, t: int, left: FootSample | None, right: FootSample | None, head: HeadSample | None, yaw: float
    ) -> GaitOutputs:
        """The gait at ``t`` ns, which never falls; what is not known is None.

        ``yaw``: where the pelvis faces in the stage, as the body has it, rad, 0 towards -Z, positive to the left.
        """
        dt = 0.0 if self._t is None else (t - self._t) * 1e-9
        if not 0.0 <= dt < _HOLE_S:
            dt = 0.0
        self._t = t
        known_left, known_right = left is not None, right is not None
        if self._settings.headset_alone and self._on_head_alone(t, known_left or known_right, head):
            assert head is not None
            left, right = self._bob.update(t, head)
        samples: dict[Side, FootSample | None] = {"left": left, "right": right}
        for phases, foot in zip(self._feet, (left, right), strict=True):
            if foot is None:
                phases.reset()
            else:
                phases.update(t, foot)
        happened = self._steps.update(t, samples)
        legs = self.legs.update(t, dt, self._feet, self._steps)
        state = GaitState(
            left=_foot_gait(self._feet.left) if known_left else None,
            right=_foot_gait(self._feet.right) if known_right else None,
            cadence=self._steps.cadence(t),
            speed=legs.speed,
            steps=self._steps.count,
        )
        events = tuple(
            (at, GaitEvent.model_validate({"side": side, "event": name, "step": number}))
            for at, name, side, number in happened
        )
        return GaitOutputs(state, self._targets(legs, (-math.sin(yaw), 0.0, -math.cos(yaw))), events)

    def _on_head_alone(self, t: int, feet: bool, head: HeadSample | None) -> bool:
        if feet or head is None:
            self._alone_since, alone = None, False
        else:
            self._alone_since = t if self._alone_since is None else self._alone_since
            alone = (t - self._alone_since) * 1e-9 >= _ALONE_S
        if alone != self._alone:
            self._alone = alone
            self._bob.reset()
            for phases in self._feet:
                phases.reset()
        return alone

    def _targets(self, legs: LegTargets, heading: tuple[float, float, float]) -> IkTargets:
        wearer = self._wearer
        half = 0.5 * wearer.hip_width
        return IkTargets(
            mode="walk" if legs.walking else "stand",
            left=self._foot(legs.left, -half, wearer.left.ankle_height, legs.pelvis_dy),
            right=self._foot(legs.right, half, wearer.right.ankle_height, legs.pelvis_dy),
            pelvis_dy=legs.pelvis_dy,
            speed=legs.speed,
            heading=heading,
        )

    def _foot(self, target: LegTarget, x: float, ankle_height: float, pelvis_dy: float) -> IkFoot:
        y = ankle_height + target.y
        hip = ankle_height + self._wearer.leg + pelvis_dy
        half = 0.5 * target.pitch
        return IkFoot(
            p=(x, y, -target.z),
            q=(math.sin(half), 0.0, 0.0, math.cos(half)),
            hint=(x, 0.5 * (hip + y), -0.5 * target.z - HINT_AHEAD),
        )


def _foot_gait(phases: FootPhases) -> FootGait:
    return FootGait(phase=phases.phase, height=phases.height, vy=phases.vy)


def _make_legs(settings: GaitSettings, wearer: Wearer) -> Legs:
    if settings.mode == "reference":
        return ReferenceLegs(lerp=settings.lerp, most_speed=settings.most_speed)
    if settings.mode == "keyframe":
        return KeyframeLegs(wearer.leg)
    return WalkingLegs(wearer.leg)
