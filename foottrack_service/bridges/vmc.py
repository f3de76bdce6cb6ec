"""VMC protocol, towards a marionette (https://protocol.vmc.info/marionette-spec): humanoid bones in their parents.

Bones have the names of Unity's HumanBodyBones; positions and rotations are local and in Unity's axes. Rotations are
those of a model in VRM's normalised rest pose, where every bone is aligned with the axes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from foottrack_protocol.messages import BodyPose
from foottrack_service import unity_axes
from foottrack_service.bridges.limbs import Leg, leg
from foottrack_service.bridges.osc import Osc, bundle
from foottrack_service.bridges.settings import VmcSettings
from foottrack_service.rotations import conjugate, from_yaw, multiply, unrotate, yaw_of

_BONE, _ROOT, _OK, _TIME = "/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos", "/VMC/Ext/OK", "/VMC/Ext/T"


class Vmc:
    """One bundle for each pose. The root stands on the stage's floor under the hips and turns with them.

    ``/VMC/Ext/OK`` is 0 while there are no hips: without a headset the legs hang on nothing.
    """

    def __init__(self, settings: VmcSettings) -> None:
        self._legs_only = settings.legs_only
        self._start: int | None = None

    def datagrams(self, pose: BodyPose, t: int) -> list[bytes]:
        """See Bridge."""
        if self._start is None:
            self._start = t
        messages = [] if self._legs_only else [Osc(_OK, (int(pose.hips is not None),))]
        messages.append(Osc(_TIME, ((t - self._start) * 1e-9,)))
        if pose.hips is not None:
            hips_p, hips_q = pose.hips.p, pose.hips.q
            if not self._legs_only:
                root_q = from_yaw(yaw_of(hips_q))
                messages.append(_transform(_ROOT, "root", (hips_p[0], 0.0, hips_p[2]), root_q))
                messages.append(_transform(_BONE, "Hips", (0.0, hips_p[1], 0.0), multiply(conjugate(root_q), hips_q)))
            for side, foot in (("Left", pose.left), ("Right", pose.right)):
                limb = leg(pose.hips, foot)
                if limb is not None:
                    messages += _leg(side, limb, hips_p, hips_q)
        return [bundle(messages)]

    def farewell(self) -> list[bytes]:
        """See Bridge."""
        return [] if self._legs_only else [bundle([Osc(_OK, (0,))])]


def _leg(side: str, limb: Leg, hips_p: tuple[float, ...], hips_q: tuple[float, ...]) -> list[Osc]:
    chain = [
        ("UpperLeg", limb.hip, limb.thigh_q),
        ("LowerLeg", limb.knee, limb.shank_q),
        ("Foot", limb.ankle, limb.foot_q),
        ("Toes", limb.toes, limb.foot_q),
    ]
    messages = []
    parent_p, parent_q = np.asarray(hips_p), np.asarray(hips_q)
    for name, p, q in chain:
        local = unrotate(parent_q, p - parent_p)
        messages.append(_transform(_BONE, f"{side}{name}", local, multiply(conjugate(parent_q), q)))
        parent_p, parent_q = p, q
    return messages


def _transform(address: str, name: str, p: npt.ArrayLike, q: npt.ArrayLike) -> Osc:
    return Osc(address, (name, *unity_axes.position(p), *unity_axes.rotation(q)))
