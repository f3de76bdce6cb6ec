"""Fused feet through the gait, as arrays: the same feet for every way to move the avatar's legs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import BodyPose, FootPose, Side
from foottrack_service.body.facing import head_yaw
from foottrack_service.body.skeleton import Skeleton
from foottrack_service.config import Settings
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.gait_link import wearer
from foottrack_service.fusion.offline import fuse
from foottrack_service.gait.gait import Gait
from foottrack_service.gait.reference import ReferenceLegs
from foottrack_service.gait.samples import FootSample, HeadSample
from foottrack_service.gait.settings import GaitSettings
from foottrack_service.rotations import Array

Mode = Literal["ours", "reference", "keyframe"]
MODES: tuple[Mode, ...] = ("ours", "reference", "keyframe")


class Instant(NamedTuple):
    """What fusion knew at ``t`` ns."""

    t: int
    left: FootSample | None
    right: FootSample | None
    head: HeadSample | None
    yaw: float = 0.0
    """Of the pelvis, rad."""


class Event(NamedTuple):
    """An event of the gait; ``t`` s when it happened, ``known`` s when it was published."""

    t: float
    known: float
    side: Side | None
    name: str


@dataclass(frozen=True, slots=True)
class GaitRun:
    """What came out. n outputs, oldest first."""

    t: Array
    """s, (n,)."""
    feet: dict[Side, Array]
    """Targets' z (forward), y above standing, m, (n, 2)."""
    speed: Array
    """m/s."""
    cadence: Array
    """steps/s."""
    lifted: dict[Side, Array]
    """When the mode noticed that a foot leaves, s."""
    events: list[Event]
    steps: int


def feet_of(arrivals: Iterable[tuple[int, Message]], settings: Settings) -> list[Instant]:
    """Fuse measurements in order of arrival (ns); truth is left out. Their IMUs are taken to live throughout."""
    core = FusionCore(settings)
    measured = ((at, message) for at, message in arrivals if not message.stream.startswith("truth/"))
    return [_instant(found) for found in fuse(measured, core) if found.stream == "pose/body"]


def run_gait(instants: Iterable[Instant], settings: Settings, mode: Mode = "ours", *, lerp: bool = True) -> GaitRun:
    """Feed a gait of this mode."""
    chosen = GaitSettings(**{**settings.gait.model_dump(), "mode": mode, "lerp": lerp})
    gait = Gait(wearer(settings, Skeleton.of(settings.body)), chosen)
    ankle = {side: settings.feet.of(side).ankle_height for side in SIDES}
    rows: list[tuple[float, ...]] = []
    events: list[Event] = []
    lifted: dict[Side, list[float]] = {"left": [], "right": []}
    up = {"left": False, "right": False}
    steps = 0
    for at, left, right, head, yaw in instants:
        out = gait.update(at, left, right, head, yaw)
        t, ik = at * 1e-9, out.ik
        rows.append((t, -ik.left.p[2], ik.left.p[1], -ik.right.p[2], ik.right.p[1], ik.speed, out.state.cadence))
        events += [Event(when * 1e-9, t, event.side, event.event) for when, event in out.events]
        steps = out.state.steps
        for index, side in enumerate(SIDES):
            if isinstance(gait.legs, ReferenceLegs):
                rises = gait.legs.phases[index].phase == "ascending"
            else:
                foot = out.state.left if side == "left" else out.state.right
                rises = foot is not None and foot.phase != "stance"
            if rises and not up[side]:
                lifted[side].append(t)
            up[side] = rises
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    return GaitRun(
        t=table[:, 0],
        feet={side: table[:, 1 + 2 * i : 3 + 2 * i] - [0.0, ankle[side]] for i, side in enumerate(SIDES)},
        speed=table[:, 5],
        cadence=table[:, 6],
        lifted={side: np.array(found) for side, found in lifted.items()},
        events=events,
        steps=steps,
    )


def _instant(message: Message) -> Instant:
    body: BodyPose = message.data
    head = None if body.head is None else HeadSample(body.head.p, body.head.q)
    yaw = 0.0 if body.hips is None else head_yaw(body.hips.q)
    return Instant(message.t, _foot(body.left), _foot(body.right), head, yaw)


def _foot(foot: FootPose | None) -> FootSample | None:
    if foot is None:
        return None
    return FootSample(foot.ankle.p, foot.ankle.q, foot.v, foot.contact)
