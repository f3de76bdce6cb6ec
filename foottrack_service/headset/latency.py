"""How late a headset's stamps are against the camera's, from feet that stand still while the head turns.

A tag that stands has one place in the stage. Composed with the head pose of the wrong instant, that place moves when
the head does; the shift of time at which it moves least is what head and camera disagree by. Neither side can know
this alone, and it is what fusion needs: 10 ms of it are 15 mm at the feet of a head that turns at 1 rad/s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations
from foottrack_service.rotations import Array

RANGE_S = (-0.06, 0.12)
STEP_S = 0.002
MIN_TURNING_RAD_S = 0.2
MIN_FIXES = 60
_SPREAD_FLOOR_M = 1e-3


class HeadTrack(NamedTuple):
    """Tracked poses of one origin: ``t`` (n,) ns rising, ``p`` (n, 3) m, ``q`` (n, 4) head to stage."""

    t: npt.NDArray[np.int64]
    p: Array
    q: Array


class Fixes(NamedTuple):
    """A standing tag as the camera saw it: ``t`` (m,) ns, ``p`` (m, 3) m, head frame."""

    t: npt.NDArray[np.int64]
    p: Array


class Latency(NamedTuple):
    """``seconds`` that head stamps come after the camera's, good to ``sigma``; ``spread`` m is left of the motion."""

    seconds: float
    sigma: float
    spread: float


class Unobservable(Exception):
    """The data does not determine the latency; the text says what was missing."""


def head_against_camera(head: HeadTrack, tags: Sequence[Fixes]) -> Latency:
    """The latency of head stamps relative to the camera's. Raises Unobservable."""
    seen = sum(len(tag.t) for tag in tags)
    if seen < MIN_FIXES or len(head.t) < MIN_FIXES:
        raise Unobservable(f"{seen} sights of tags and {len(head.t)} head poses: at least {MIN_FIXES} are needed")
    steps = rotations.angle_between(head.q[:-1], head.q[1:])
    turning = float(np.sqrt(np.mean(np.square(steps / np.maximum(np.diff(head.t) * 1e-9, 1e-3)))))
    if turning < MIN_TURNING_RAD_S:
        raise Unobservable(f"the head turned at {turning:.2f} rad/s: look left and right, up and down, briskly")
    shifts = np.arange(RANGE_S[0], RANGE_S[1] + 0.5 * STEP_S, STEP_S)
    costs = np.array([_cost(head, tags, shift) for shift in shifts])
    best = int(np.argmin(costs))
    if best in (0, len(shifts) - 1):
        raise Unobservable(f"beyond {1e3 * shifts[best]:.0f} ms: do the feet stand still, and is the headset tracked?")
    # Near its minimum the cost is a parabola; its curvature says how well the minimum is known.
    a, b, c = costs[best - 1 : best + 2]
    bend = a - 2.0 * b + c
    seconds = float(shifts[best] + 0.5 * STEP_S * (a - c) / bend)
    spread = float(np.sqrt(b))
    sigma = STEP_S * float(np.sqrt(2.0 * max(b, _SPREAD_FLOOR_M**2) / (bend * seen)))
    return Latency(seconds, sigma, spread)


def _cost(head: HeadTrack, tags: Sequence[Fixes], shift_s: float) -> float:
    """Mean squared distance, m^2, of each tag from its own median place, the farthest tenth left out."""
    squares = []
    for tag in tags:
        if len(tag.t):
            p, q = _at(head, tag.t + round(shift_s * 1e9))
            places = p + rotations.rotate(q, tag.p)
            squares.append(np.sum(np.square(places - np.median(places, axis=0)), axis=1))
    ordered = np.sort(np.concatenate(squares))
    return float(np.mean(ordered[: max(1, int(0.9 * len(ordered)))]))


def _at(head: HeadTrack, t: npt.NDArray[np.int64]) -> tuple[Array, Array]:
    after = np.clip(np.searchsorted(head.t, t), 1, len(head.t) - 1)
    t0, t1 = head.t[after - 1], head.t[after]
    share = np.clip((t - t0) / np.maximum(t1 - t0, 1), 0.0, 1.0)
    p = head.p[after - 1] + share[:, None] * (head.p[after] - head.p[after - 1])
    return p, rotations.slerp(head.q[after - 1], head.q[after], share)
