"""Fused feet as the gait takes them, and the person's measures."""

from __future__ import annotations

from collections.abc import Mapping

from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.config import FootSettings, Settings
from foottrack_service.fusion.interface import COASTING_S, FootEstimate, HeadSample
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
        self,
        now: int,
        feet: Mapping[Side, FootEstimate],
        imu_t: Mapping[Side, int | None],
        head: HeadSample | None,
        yaw: float,
    ) -> samples.GaitOutputs:
        """The gait at ``now`` ns; ``imu_t``: when each foot's IMU was last heard, ns; ``yaw`` of the pelvis, rad."""
        left, right = (foot_sample(feet.get(side), now, imu_t[side]) for side in SIDES)
        return self._gait.update(now, left, right, head_sample(head), yaw)


def wearer(settings: Settings, skeleton: Skeleton) -> samples.Wearer:
    """The measures that the gait needs."""
    return samples.Wearer(
        height=skeleton.height,
        leg=skeleton.thigh + skeleton.shank,
        hip_width=skeleton.hip_width,
        left=_shoe(settings.feet.left),
        right=_shoe(settings.feet.right),
    )


def foot_sample(found: FootEstimate | None, now: int, imu_t: int | None) -> samples.FootSample | None:
    """None for a foot that nobody measures any more.

    A foot that is lost only because its place in the room has become too uncertain still has a gait.
    """
    if found is None:
        return None
    if found.stage == "lost" and (imu_t is None or (now - imu_t) * 1e-9 > COASTING_S):
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
