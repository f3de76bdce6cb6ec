"""A scenario: what happened, and all messages that sensors and publishers would have made of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from foottrack_protocol.envelope import Message
from foottrack_service.config import Settings
from foottrack_service.simulation import disturbances, headset, optical
from foottrack_service.simulation.emission import (
    Emission,
    head_emission,
    imu_emission,
    optical_emission,
    truth_emission,
)
from foottrack_service.simulation.faults import Fault
from foottrack_service.simulation.footwear import Feet
from foottrack_service.simulation.imu import ImuKind
from foottrack_service.simulation.imu import measured as measured_by_imu
from foottrack_service.simulation.tasks import TASKS, Maker
from foottrack_service.simulation.truth import BOTH, Truth

_HOP_NS = 150_000
"""From publishing to the subscriber: what a hop through the proxy takes."""


@dataclass(frozen=True)
class Scenario:
    """One run of one task. The same arguments give the same bytes."""

    task: str
    seed: int
    seconds: float
    settings: Settings
    truth: Truth
    """In the stage as it lay at the start; ``truth/*`` messages follow a stage that is recentred."""
    emissions: tuple[Emission, ...]
    start: int = 0
    """Bus time of the scenario's t = 0, ns."""

    @property
    def sid(self) -> str:
        """The publishers' session id."""
        return hashlib.sha256(f"{self.task} {self.seed}".encode()).hexdigest()[:12]

    def at(self, start: int) -> Scenario:
        """The same at another bus time, ns."""
        return replace(self, start=start)

    def messages(self) -> Iterator[tuple[int, Message]]:
        """(arrival at a subscriber, bus ns; message), in order of arrival."""
        user, sid, start = self.settings.user, self.sid, self.start
        t_pub = np.concatenate([e.t_pub for e in self.emissions])
        order = np.argsort(t_pub, kind="stable")
        which = np.repeat(np.arange(len(self.emissions)), [len(e.t) for e in self.emissions])[order].tolist()
        index = np.concatenate([np.arange(len(e.t)) for e in self.emissions])[order].tolist()
        for number, seq in zip(which, index, strict=True):
            emission = self.emissions[number]
            published = start + int(emission.t_pub[seq])
            t, body = start + int(emission.t[seq]), emission.body(seq, start)
            message = Message(user, emission.stream, emission.src, sid, seq, t, published, True, body)
            yield published + _HOP_NS, message

    def false_fixes(self) -> frozenset[tuple[str, int]]:
        """(stream, seq) of the optical measurements that do not show what they say."""
        return frozenset(
            (e.stream, int(seq)) for e in self.emissions if e.false is not None for seq in np.flatnonzero(e.false)
        )


def simulate(
    task: str,
    seed: int,
    *,
    settings: Settings | None = None,
    seconds: float | None = None,
    imu_hz: float = 100.0,
    imu: ImuKind = "fused",
    feet: Feet = "mild",
    left_imu: bool = True,
    right_imu: bool = True,
    camera: bool = True,
    depth: bool = True,
    faults: Sequence[Fault] = (),
    start: int = 0,
    motion: Maker | None = None,
) -> Scenario:
    """Simulate a task, or a ``motion`` of one's own under the task's name.

    Raises ValueError for an unknown task, a rate or a length that cannot be.

    Every sensor draws from a stream of its own, so leaving one out, or a fault in one, changes no other's noise.
    """
    if motion is None and task not in TASKS:
        raise ValueError(f"no task is called {task!r}; there are {', '.join(TASKS)}")
    length = seconds if seconds is not None else TASKS[task].seconds if motion is None else 30.0
    if not 1.0 <= length <= 3600.0:
        raise ValueError(f"a scenario lasts 1 to 3600 s, not {length:g}")
    if not 20.0 <= imu_hz <= 1600.0:
        raise ValueError(f"an IMU samples at 20 to 1600 Hz, not {imu_hz:g}")
    settings = settings or Settings()
    seeds = np.random.SeedSequence([seed, *task.encode()])
    moving, *imus, head, pictures, disturbed = seeds.spawn(6)
    maker = TASKS[task].truth if motion is None else motion
    truth = maker(length, settings, feet, np.random.default_rng(moving))
    drawn = list(zip(faults, map(np.random.default_rng, disturbed.spawn(len(faults))), strict=True))

    emissions = []
    for side, worn, own in zip(BOTH, (left_imu, right_imu), imus, strict=True):
        if worn:
            placed, delay = settings.feet.of(side).imu, settings.timing.imu_delay
            random = np.random.default_rng(own)
            samples = measured_by_imu(truth.feet[side], placed, length, imu_hz, imu, delay, random)
            emissions.append(imu_emission(side, disturbances.on_imu(samples, side, drawn)))
    if camera:
        emissions += _pictures(truth, settings, length, depth, drawn, pictures)
    poses = headset.measured(truth.head, length, faults, np.random.default_rng(head))
    changes, stages = headset.stages(faults)
    emissions.append(head_emission(poses))
    emissions += [truth_emission(side, truth.feet[side], length, changes, stages) for side in BOTH]
    return Scenario(task, seed, length, settings, truth, tuple(emissions), start)


def _pictures(
    truth: Truth,
    settings: Settings,
    seconds: float,
    depth: bool,
    drawn: disturbances.Drawn,
    seeds: np.random.SeedSequence,
) -> list[Emission]:
    own, *rest = map(np.random.default_rng, seeds.spawn(5))
    run = optical.pictures(seconds, own)
    faults = [fault for fault, _ in drawn]
    found = {
        side: optical.markers(truth, side, settings, run, faults, random)
        for side, random in zip(BOTH, rest[:2], strict=True)
    }
    disturbances.on_markers(found, truth, settings, drawn)
    emissions = [optical_emission("marker", side, samples) for side, samples in found.items()]
    if depth:
        found = {
            side: optical.blobs(truth, side, settings, run, faults, random)
            for side, random in zip(BOTH, rest[2:], strict=True)
        }
        disturbances.on_blobs(found, drawn)
        emissions += [optical_emission("depth", side, samples) for side, samples in found.items()]
    return emissions
