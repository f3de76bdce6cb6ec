"""Faults applied to what healthy sensors would have said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields

import numpy as np

from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.rotations import Array
from foottrack_service.simulation import camera, faults
from foottrack_service.simulation.imu import ImuSamples
from foottrack_service.simulation.optical import OpticalSamples, lay_flat, put_false
from foottrack_service.simulation.truth import BOTH, Flags, Truth

Drawn = Sequence[tuple[faults.Fault, np.random.Generator]]
"""Faults, each with random numbers of its own."""


def on_imu(samples: ImuSamples, side: Side, drawn: Drawn) -> ImuSamples:
    """One IMU with its faults."""
    true_t = samples.t.copy()
    keep = np.ones(len(true_t), dtype=np.bool_)
    for fault, random in drawn:
        if isinstance(fault, faults.ClockJump):
            if fault.source == f"imu-{side}":
                samples.t[fault.covers(true_t)] += fault.offset
        elif getattr(fault, "side", None) != side:
            continue
        elif isinstance(fault, faults.ImuDropout):
            keep &= ~fault.covers(true_t)
        elif isinstance(fault, faults.PacketLoss):
            keep &= ~faults.chosen(fault, true_t, fault.share, random)
        elif isinstance(fault, faults.RepeatedStamps):
            repeats = np.flatnonzero(faults.chosen(fault, true_t, fault.share, random))
            repeats = repeats[repeats > 0]
            samples.t[repeats] = samples.t[repeats - 1]
        elif isinstance(fault, faults.ReversedStamps):
            first = np.flatnonzero(faults.chosen(fault, true_t, fault.share, random)[:-1])
            for i in first:
                samples.t[[i, i + 1]] = samples.t[[i + 1, i]]
        elif isinstance(fault, faults.Saturation):
            covered = fault.covers(true_t)
            samples.acc[covered] = np.clip(samples.acc[covered], -fault.limit, fault.limit)
        elif isinstance(fault, faults.NotANumber):
            samples.acc[faults.chosen(fault, true_t, fault.share, random), 1] = np.nan
    return samples.kept(keep)


def on_markers(samples: Mapping[Side, OpticalSamples], truth: Truth, settings: Settings, drawn: Drawn) -> None:
    """Both feet's markers with the camera's faults, in place. Both have the same pictures."""
    for fault, random in drawn:
        if isinstance(fault, faults.FalseTags):
            found = samples[fault.side]
            spots, seen = _floor_spot(truth, settings, found, fault, random)
            chosen = faults.chosen(fault, found.t, fault.share, random)
            put_false(found, chosen & seen, spots, truth, settings, random)
            if fault.lies:
                lay_flat(found, chosen & seen, truth, random)
        elif isinstance(fault, faults.WrongIdentity):
            other = samples["right" if fault.side == "left" else "left"]
            _copy(other, samples[fault.side], fault.covers(other.t) & other.found)
    _on_pictures(samples, drawn)


def on_blobs(samples: Mapping[Side, OpticalSamples], drawn: Drawn) -> None:
    """Both feet's depth blobs with the camera's faults, in place."""
    _on_pictures(samples, drawn)


def _on_pictures(samples: Mapping[Side, OpticalSamples], drawn: Drawn) -> None:
    for fault, _ in drawn:
        if isinstance(fault, faults.SwappedSides):
            left, right = (samples[side] for side in BOTH)
            swapped = fault.covers(left.t)
            kept = left.kept(np.ones(len(left.t), dtype=np.bool_))
            _copy(right, left, swapped)
            _copy(kept, right, swapped)
        elif isinstance(fault, faults.CameraBlackout):
            for found in samples.values():
                found.found &= ~fault.covers(found.t)
    for fault, _ in drawn:
        if isinstance(fault, faults.ClockJump) and fault.source == "camera":
            for found in samples.values():
                found.t[fault.covers(found.t)] += fault.offset


def _copy(source: OpticalSamples, to: OpticalSamples, where: Flags) -> None:
    """Let one foot's finds pass for the other's."""
    for part in fields(OpticalSamples):
        array = getattr(to, part.name)
        if array is not None:
            array[where] = getattr(source, part.name)[where]
    to.false[where] = True


def _floor_spot(
    truth: Truth, settings: Settings, found: OpticalSamples, fault: faults.Fault, random: np.random.Generator
) -> tuple[Array, Flags]:
    """A spot on the floor before the feet amid the fault: its pixels (n, 2), and whether it is in the picture."""
    middle = 0.5 * (truth.left.pose(found.t)[0] + truth.right.pose(found.t)[0])
    amid = np.flatnonzero(fault.covers(found.t))
    spot = middle[amid[len(amid) // 2] if len(amid) else 0] + [
        random.uniform(-0.4, 0.4),
        0.0,
        random.uniform(-0.5, 0.2),
    ]
    spot[1] = 0.0
    eye = camera.eye(truth, found.t, settings.camera.mount, ())
    pixels, depth = camera.project(eye, np.broadcast_to(spot, middle.shape))
    limits = np.array([camera.WIDTH, camera.HEIGHT])
    seen: Flags = (depth > 0.3) & np.all((pixels > 12.0) & (pixels < limits - 12.0), axis=-1)
    return pixels, seen
