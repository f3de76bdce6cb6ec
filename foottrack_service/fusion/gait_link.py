"""Fused feet as the gait takes them, and the person's measures."""

from __future__ import annotations

from foottrack_service.body.skeleton import Skeleton
from foottrack_service.config import FootSettings, Settings
from foottrack_service.fusion.interface import FootEstimate, HeadSample
from foottrack_service.gait import samples
from foottrack_service.gait.gait import Gait


class GaitLink:
    """The gait of the core's user."""

    def __init__(self, settings: Settings, skeleton: Skeleton) -> None:
        self._settings = settings
        self._wearer = wearer(settings, skeleton)
        self._gait = Gait(self._wearer, settings.gait)

    def wear(self, skeleton: Skeleton) -> None:
        """The body was calibrated: other measures begin a new gait. The same ones come every 5 s and change nothing."""
        found = wearer(self._settings, skeleton)
        if found != self._wearer:
            self._wearer, self._gait = found, Gait(found, self._settings.gait)

    def update(
        self, now: int, left: FootEstimate | None, right: FootEstimate | None, head: HeadSample | None
    ) -> samples.GaitOutputs:
        """The gait at ``now`` ns."""
        return self._gait.update(now, foot_sample(left), foot_sample(right), head_sample(head))


def wearer(settings: Settings, skeleton: Skeleton) -> samples.Wearer:
    """The measures that the gait needs."""
    return samples.Wearer(
        height=skeleton.height,
        leg=skeleton.thigh + skeleton.shank,
        hip_width=skeleton.hip_width,
        left=_shoe(settings.feet.left),
        right=_shoe(settings.feet.right),
    )


def foot_sample(found: FootEstimate | None) -> samples.FootSample | None:
    """None for a foot that is unknown or lost."""
    if found is None or found.stage == "lost":
        return None
    x, y, z = found.p.tolist()
    qx, qy, qz, qw = found.q.tolist()
    vx, vy, vz = found.v.tolist()
    return samples.FootSample((x, y, z), (qx, qy, qz, qw), (vx, vy, vz), found.contact)


def head_sample(head: HeadSample | None) -> samples.HeadSample | None:
    """None where there is none."""
    if head is None:
        return None
    x, y, z = head.p.tolist()
    qx, qy, qz, qw = head.q.tolist()
    return samples.HeadSample((x, y, z), (qx, qy, qz, qw))


def _shoe(foot: FootSettings) -> samples.Shoe:
    return samples.Shoe(foot.ankle_height, -foot.toe.p[2], -foot.toe.p[1])
