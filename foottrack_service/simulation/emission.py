"""Sensors' samples as messages-to-be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from foottrack_protocol.messages import HeadPose, Imu, Optical, Pose, Side
from foottrack_protocol.messages import Truth as TruthBody
from foottrack_service.rotations import Array
from foottrack_service.simulation.headset import HeadSamples, Stage
from foottrack_service.simulation.imu import ImuSamples
from foottrack_service.simulation.optical import OpticalSamples
from foottrack_service.simulation.truth import Track

Nanoseconds = npt.NDArray[np.int64]

_HAND_OVER_S = 50e-6
"""From a sample's arrival to its publishing."""
TRUTH_HZ = 100.0
_TRUTH_LATENCY_S = 5e-3


@dataclass(frozen=True)
class Emission:
    """All messages of one stream, in order. Times in ns from the scenario's start."""

    stream: str
    src: str
    t: Nanoseconds
    t_pub: Nanoseconds
    body: Callable[[int, int], Any]
    """(index, bus ns of the scenario's start) to a message's body."""
    false: npt.NDArray[np.bool_] | None = None
    """Finds that are not of this foot's target."""


def imu_emission(side: Side, samples: ImuSamples) -> Emission:
    """``imu/<side>``."""
    acc, t_dev, t_arr = samples.acc.tolist(), samples.t_dev.tolist(), _ns(samples.t_arr).tolist()
    gyro = None if samples.gyro is None else samples.gyro.tolist()
    q = None if samples.q is None else samples.q.tolist()
    finite = np.all(np.isfinite(samples.acc), axis=-1)

    def body(i: int, start: int) -> Imu:
        # A NaN is a fault that a validated body cannot hold: this is what a broken producer would send.
        make = Imu if finite[i] else Imu.model_construct
        return make(
            acc=acc[i],
            gyro=None if gyro is None else gyro[i],
            q=None if q is None else q[i],
            t_dev=t_dev[i],
            t_arr=start + t_arr[i],
            accuracy=None if q is None else 3,
        )

    return Emission(f"imu/{side}", f"imu-{side}", _ns(samples.t), _ns(samples.t_arr + _HAND_OVER_S), body)


def optical_emission(kind: str, side: Side, samples: OpticalSamples) -> Emission:
    """``marker/<side>`` or ``depth/<side>``: what was found."""
    samples = samples.kept(samples.found)
    p, cov, edge, frame = samples.p.tolist(), samples.cov.tolist(), samples.edge_px.tolist(), samples.frame.tolist()
    q = None if samples.q is None else samples.q.tolist()
    q_alt = None if samples.q_alt is None else samples.q_alt.tolist()
    ratio = None if samples.size_ratio is None else samples.size_ratio.tolist()
    reproj = None if samples.reproj_px is None else samples.reproj_px.tolist()

    def body(i: int, start: int) -> Optical:
        return Optical(
            p=p[i],
            q=None if q is None else q[i],
            q_alt=None if q_alt is None else q_alt[i],
            cov=cov[i],
            size_ratio=None if ratio is None else ratio[i],
            reproj_px=None if reproj is None else reproj[i],
            edge_px=edge[i],
            frame=frame[i],
        )

    return Emission(f"{kind}/{side}", "camera", _ns(samples.t), _ns(samples.t_pub), body, samples.false)


def head_emission(samples: HeadSamples) -> Emission:
    """``head/pose``."""
    p, q, origin = samples.p.tolist(), samples.q.tolist(), samples.origin.tolist()
    tracked = samples.tracked.tolist()
    first = {origin.index(number) for number in range(1, len(samples.stages)) if number in origin}
    moves = [None if s.moved is None else Pose(p=s.moved[0].tolist(), q=s.moved[1].tolist()) for s in samples.stages]

    def body(i: int, start: int) -> HeadPose:
        known = tracked[i]
        return HeadPose(
            p=p[i] if known else None,
            q=q[i] if known else None,
            tracked=known,
            origin=origin[i],
            moved=moves[origin[i]] if i in first else None,
        )

    return Emission("head/pose", "headset", _ns(samples.t), _ns(samples.t_arr + _HAND_OVER_S), body)


def truth_emission(side: Side, track: Track, seconds: float, changes: Array, stages: list[Stage]) -> Emission:
    """``truth/<side>``, in the stage as it lies at the time."""
    t = np.arange(int(seconds * TRUTH_HZ)) / TRUTH_HZ
    p, q = track.pose(t)
    origin = np.searchsorted(changes, t, side="right")
    for index, stage in enumerate(stages):
        here = origin == index
        p[here], q[here] = stage.place(p[here]), stage.turn(q[here])
    places, turns = p.tolist(), q.tolist()

    def body(i: int, start: int) -> TruthBody:
        return TruthBody(p=places[i], q=turns[i])

    return Emission(f"truth/{side}", "truth", _ns(t), _ns(t + _TRUTH_LATENCY_S), body)


def _ns(seconds: Array) -> Nanoseconds:
    return np.rint(seconds * 1e9).astype(np.int64)
