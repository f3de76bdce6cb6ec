"""Instants for a file of evenly spaced frames, with the contacts on frames, where animators put them.

A foot that lands between two frames slides into its contact in every viewer, by up to 1.3 mm at 60 fps. So time
is bent, smoothly and by at most half a frame, until every strike and every toe-off falls on a frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from foottrack_service.walkcycle.walk import Contact, Motion, Walk

Array = npt.NDArray[np.float64]

_END_S = 1e-6
"""So close to its ends, where the phase stands still, a walk has no instants of its own."""


@dataclass(frozen=True)
class Frames:
    """Frame times in the file (n,) s, evenly spaced, and the instants of the walk that they show (n,) s."""

    fps: float
    times: Array
    instants: Array

    def motion(self, walk: Walk) -> Motion:
        """The walk as the file has it."""
        return replace(walk.motion(self.instants), times=self.times)

    def contacts(self, walk: Walk) -> list[Contact]:
        """The walk's contacts in the file's time."""

        def moved(interval: tuple[float, float] | None) -> tuple[float, float] | None:
            if interval is None:
                return None
            first, last = np.interp(interval, self.instants, self.times)
            return float(first), float(last)

        return [replace(contact, heel=moved(contact.heel), ball=moved(contact.ball)) for contact in walk.contacts]


def even_frames(walk: Walk, fps: float) -> Frames:
    """Frames of the whole walk with strikes and toe-offs on frames."""
    knots, frames = [0.0], [0]
    last = max(1, round(walk.duration * fps))
    for edge in contact_edges(walk):
        frame = round(edge * fps)
        # Two edges within one frame cannot both have it: the first one keeps it.
        if frames[-1] < frame < last and edge > knots[-1]:
            knots.append(edge)
            frames.append(frame)
    knots.append(walk.duration)
    frames.append(last)
    times = np.arange(last + 1) / fps
    if len(knots) == 2:
        return Frames(fps, times, times * (walk.duration * fps / last))
    instants = PchipInterpolator(np.array(frames) / fps, knots)(times)
    instants[frames] = knots
    return Frames(fps, times, instants)


def contact_edges(walk: Walk, *, flat: bool = False) -> Array:
    """Instants of strikes and toe-offs in order, (k,) s; with `flat`, of foot flat and heel off too."""
    edges: set[float] = set()
    for contact in walk.contacts:
        for interval in (contact.heel, contact.ball):
            if interval is not None:
                edges.update(interval if flat else ())
        ends = [interval for interval in (contact.heel, contact.ball) if interval is not None]
        edges.update((min(i[0] for i in ends), max(i[1] for i in ends)))
    return np.array(sorted(edge for edge in edges if _END_S < edge < walk.duration - _END_S))
