"""Fused feet as the gait takes them, and the person's measures."""

from __future__ import annotations

from foottrack_service.body.skeleton import Skeleton
from foottrack_service.config import FootSettings, Settings
from foottrack_service.fusion.interface import FootEstimate, HeadSample
from foottrack_service.gait import samples


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
