"""A headset that says where the head is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations
from foottrack_service.rotations import Array
from foottrack_service.simulation import noise
from foottrack_service.simulation.faults import ClockJump, Fault, HeadsetLost, HeadsetRecentred
from foottrack_service.simulation.truth import Flags, Track

HEAD_HZ = 90.0
# Niehorster, Li and Lappe 2017 (HTC Vive): at rest below 0.2 mm and 0.02 deg RMS. A slow wander comes on top (Bauer et
# al. 2021: reproducible within millimetres); the tilted ground plane that both saw is no noise and left out.
_P_NOISE = 0.2e-3  # m SD, white
_Q_NOISE = math.radians(0.02)  # rad SD, white
_P_WANDER, _Q_WANDER, _WANDER_TAU_S = 0.5e-3, math.radians(0.03), 20.0
LATENCY_S, _LATENCY_JITTER_S = 5e-3, 0.5e-3  # s; poses are polled, so the 22 ms to the display do not count


@dataclass
class HeadSamples:
    """A run of the headset, n samples in order of arrival. Times in s."""

    t: Array
    t_arr: Array
    p: Array
    q: Array
    tracked: Flags
    origin: npt.NDArray[np.int64]
    stages: list[Stage]
    """Per `origin`, how the stage lies."""


@dataclass(frozen=True)
class Stage:
    """How one stage lies: what turns the first stage's coordinates into its own, and what the last one's."""

    p: Array
    q: Array
    moved: tuple[Array, Array] | None
    """From the last stage, as the source says it; None when it does not know."""

    def place(self, p: Array) -> Array:
        """Points (..., 3) of the first stage."""
        return self.p + rotations.rotate(self.q, p)

    def turn(self, q: Array) -> Array:
        """Rotations (..., 4) of the first stage."""
        return rotations.multiply(self.q, q)


def stages(faults: Sequence[Fault]) -> tuple[Array, list[Stage]]:
    """When the stage changed, s, and how each of the stages lies: one more than changes."""
    changes = sorted((f for f in faults if isinstance(f, HeadsetRecentred)), key=lambda f: f.start)
    lies = [Stage(np.zeros(3), rotations.IDENTITY, None)]
    for change in changes:
        turn = rotations.from_yaw(change.yaw)
        shift = np.array([change.shift[0], 0.0, change.shift[1]])
        last = lies[-1]
        moved = (shift, turn) if change.known else None
        lies.append(Stage(shift + rotations.rotate(turn, last.p), rotations.multiply(turn, last.q), moved))
    return np.array([change.start for change in changes]), lies


def measured(head: Track, seconds: float, faults: Sequence[Fault], random: np.random.Generator) -> HeadSamples:
    """A run of `seconds`."""
    t = np.asarray((float(random.random()) + np.arange(math.ceil(seconds * HEAD_HZ))) / HEAD_HZ, dtype=np.float64)
    t = t[t < seconds]
    n = len(t)
    p, q = head.pose(t)
    p = p + _P_NOISE * random.standard_normal((n, 3))
    p += noise.gauss_markov(random, n, 1.0 / HEAD_HZ, _WANDER_TAU_S, _P_WANDER)
    error = _Q_NOISE * random.standard_normal((n, 3))
    error += noise.gauss_markov(random, n, 1.0 / HEAD_HZ, _WANDER_TAU_S, _Q_WANDER)
    q = rotations.multiply(q, rotations.from_rotation_vector(error))
    t_arr = np.maximum.accumulate(t + LATENCY_S + random.exponential(_LATENCY_JITTER_S, n))

    changes, lies = stages(faults)
    origin = np.searchsorted(changes, t, side="right").astype(np.int64)
    for index, stage in enumerate(lies[1:], start=1):
        after = origin == index
        p[after], q[after] = stage.place(p[after]), stage.turn(q[after])
    tracked = np.ones(n, dtype=np.bool_)
    for fault in faults:
        if isinstance(fault, HeadsetLost):
            tracked &= ~fault.covers(t)
    stamps = t.copy()
    for fault in faults:
        if isinstance(fault, ClockJump) and fault.source == "headset":
            stamps[fault.covers(t)] += fault.offset
    return HeadSamples(stamps, t_arr, p, q, tracked, origin, lies)
