"""S. H. Lee's own way of walking a cycle forward (2005), kept to be compared with.

Root compensation: in the first half of a step the root moves so that the front foot's *heel* stays where it is, in
the second so that its *ball* does. Only that one foot is held: in double support the other one slips. The printed
loop that repeats a step adds the growing offset to itself and so doubles it: 1, 2, 4, 8 steps instead of 1, 2, 3, 4.
On a curve each line segment has one heading, and no heading keys are set in the second half of a step and the first
half of the next one, so that the turn happens there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from foottrack_service.walkcycle.cycle import Cycle
from foottrack_service.walkcycle.inplace import in_place
from foottrack_service.walkcycle.measure import foot_points
from foottrack_service.walkcycle.walk import Motion

Array = npt.NDArray[np.float64]


def compensated_step(cycle: Cycle, frames: int) -> Motion:
    """One step of the cycle on a straight line, the left foot in front, (frames + 1) instants, moved forward by root
    compensation alone (no feet are planted, no leg is solved again)."""
    motion = in_place(cycle, np.linspace(0.0, 0.5, frames + 1))
    foot = foot_points(cycle.body, motion)["left"]
    hips = motion.hips.copy()
    half = frames // 2
    moved = np.zeros(frames + 1)
    moved[: half + 1] = foot.heel[0, 2] - foot.heel[: half + 1, 2]
    moved[half:] = moved[half] + foot.ball[half, 2] - foot.ball[half:, 2]
    hips[:, 2] += moved
    return replace(motion, hips=hips)


def step_offsets_as_printed(step: float, steps: int) -> Array:
    """Where each of `steps` repetitions begins when the loop is taken literally, (steps,) m: the offset doubles."""
    offsets, offset = [], step
    for _ in range(steps):
        offsets.append(offset)
        offset += offset
    return np.array(offsets)


def step_offsets_as_meant(step: float, steps: int) -> Array:
    """The same as it must be: one step more each time, (steps,) m."""
    return step * np.arange(1, steps + 1)


def heading_keys(points: npt.ArrayLike, frames: int) -> list[tuple[int, float]]:
    """Lee's curve rule: keys (frame, yaw rad) for a walk of one step per segment of `points` (k, 2).

    Step n takes `frames` frames and has its segment's heading, keyed only where no turn may happen: none in the first
    half of step n nor in the second half of step n - 1, so each turn is spread from one mid-step to the next.
    """
    edges = np.diff(np.asarray(points, dtype=np.float64), axis=0)
    yaws = np.unwrap(np.arctan2(edges[:, 0], edges[:, 1]))
    half = frames // 2
    # A step that turns neither before nor after it would be keyed in both its halves; between, only its middle is left.
    keys = [(0, float(yaws[0]))]
    keys += [(n * frames + half, float(yaw)) for n, yaw in enumerate(yaws)]
    keys.append((len(yaws) * frames, float(yaws[-1])))
    return keys


def interpolated_heading(keys: list[tuple[int, float]], frame: npt.ArrayLike) -> Array:
    """Yaw (n,) rad between heading keys, as an animation system interpolates them."""
    return np.interp(np.asarray(frame, dtype=np.float64), [f for f, _ in keys], [y for _, y in keys])
