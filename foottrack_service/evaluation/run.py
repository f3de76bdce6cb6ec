"""What a filter made of a scenario or a recording, as arrays, beside the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from foottrack_protocol import Message
from foottrack_protocol.frames import SIDES
from foottrack_protocol.messages import Side
from foottrack_service import rotations as rot
from foottrack_service.config import Settings
from foottrack_service.evaluation.truth import Flags, TruthTrack
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.filters import MakeFilter, make_filter
from foottrack_service.fusion.offline import fuse
from foottrack_service.rotations import Array

STAGES = ("marker", "depth", "inertial", "coasting", "lost")


class Truth(Protocol):
    """Where a foot really was. Instants are ns of the bus clock, shape (n,)."""

    def covers(self, t: Array) -> Flags:
        """At which instants it is known."""

    def position(self, t: Array) -> Array:
        """Ankle, m, shape (n, 3)."""

    def velocity(self, t: Array) -> Array:
        """m/s, shape (n, 3)."""

    def rotation(self, t: Array) -> Array:
        """Foot to stage, shape (n, 4)."""


@dataclass(frozen=True, slots=True)
class FootRun:
    """One foot's published estimates, oldest first. n outputs."""

    t: Array
    """ns."""
    p: Array
    """Ankle, m, (n, 3)."""
    q: Array
    """(n, 4)."""
    sigma: Array
    """m."""
    stage: Array
    """Index into STAGES."""
    contact: Flags
    age: Array
    """s; NaN before the first accepted fix."""

    def cut(self, keep: Flags) -> FootRun:
        """The outputs that are kept."""
        return FootRun(*(getattr(self, name)[keep] for name in self.__slots__))

    def point(self, arm: Array) -> Array:
        """A point of the foot (foot frame, m), (n, 3)."""
        return self.p + rot.rotate(self.q, arm)


def run_filter(
    arrivals: Iterable[tuple[int, Message]], settings: Settings, make: MakeFilter = make_filter
) -> tuple[dict[Side, FootRun], FusionCore]:
    """Fuse messages in order of arrival (ns) and collect both feet."""
    core = FusionCore(settings, make=make)
    return collect(fuse(arrivals, core)), core


def collect(results: Iterable[Message]) -> dict[Side, FootRun]:
    """Both feet of ``pose/body`` messages; outputs without a foot are left out."""
    rows: dict[Side, list[tuple[object, ...]]] = {side: [] for side in SIDES}
    for message in results:
        if message.stream != "pose/body":
            continue
        for side in SIDES:
            foot = getattr(message.data, side)
            if foot is not None:
                age = np.nan if foot.age is None else foot.age
                stage = STAGES.index(foot.stage)
                rows[side].append((message.t, foot.ankle.p, foot.ankle.q, foot.sigma, stage, foot.contact, age))
    return {side: _arrays(found) for side, found in rows.items()}


def split_truth(
    arrivals: Iterable[tuple[int, Message]], into: dict[Side, list[Message]]
) -> Iterator[tuple[int, Message]]:
    """Pass messages on, and put those of ``truth/*`` aside."""
    for arrival, message in arrivals:
        if message.stream == "truth/left":
            into["left"].append(message)
        elif message.stream == "truth/right":
            into["right"].append(message)
        else:
            yield arrival, message


def truth_of(messages: list[Message]) -> TruthTrack | None:
    """The track of one foot's ``truth`` messages; None when they are too few."""
    try:
        return TruthTrack([m.t for m in messages], [m.data.p for m in messages], [m.data.q for m in messages])
    except ValueError:
        return None


def _arrays(rows: list[tuple[object, ...]]) -> FootRun:
    t, p, q, sigma, stage, contact, age = zip(*rows, strict=True) if rows else ((), (), (), (), (), (), ())
    return FootRun(
        np.array(t, dtype=np.int64),
        np.array(p, dtype=np.float64).reshape(-1, 3),
        np.array(q, dtype=np.float64).reshape(-1, 4),
        np.array(sigma, dtype=np.float64),
        np.array(stage, dtype=np.int64),
        np.array(contact, dtype=bool),
        np.array(age, dtype=np.float64),
    )
