"""The lower body as trackers, as those who know no skeletons want it."""

from __future__ import annotations

from typing import NamedTuple

from foottrack_protocol.messages import BodyPose
from foottrack_service.bridges.limbs import leg
from foottrack_service.rotations import Array

TRACKERS = ("waist", "left_foot", "right_foot", "left_knee", "right_knee")
"""In the order in which SlimeVR numbers them too, so that who switches keeps an application's assignments."""


class Tracker(NamedTuple):
    """Where one is, stage frame, m; upright and with -Z forward when the person stands at ease."""

    p: Array | tuple[float, float, float]
    q: Array | tuple[float, float, float, float]


def trackers(pose: BodyPose, knees: bool) -> dict[str, Tracker]:
    """Those whose places are known: a foot that is lost has none."""
    found: dict[str, Tracker] = {}
    if pose.hips is not None:
        found["waist"] = Tracker(pose.hips.p, pose.hips.q)
    for side, foot in (("left", pose.left), ("right", pose.right)):
        if foot is not None and foot.stage != "lost":
            found[f"{side}_foot"] = Tracker(foot.ankle.p, foot.ankle.q)
        limb = leg(pose.hips, foot)
        if knees and limb is not None:
            found[f"{side}_knee"] = Tracker(limb.knee, limb.thigh_q)
    return found
