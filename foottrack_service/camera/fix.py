"""What a tracker found in one picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from foottrack_protocol.messages import Optical
from foottrack_service.rotations import Array


@dataclass(frozen=True)
class Fix:
    """A target's place as the wire's `Optical` body has it, and what the overlay draws.

    `t` bus-clock ns of the target's own rows; `p` (3,) m, `q`, `q_alt` (4,) or None, `cov` (3, 3) m^2 in the head
    frame; `outline` (n, 2) px is what was seen in the picture, `label` says what.
    """

    side: str
    kind: Literal["marker", "depth"]
    t: int
    frame: int
    p: Array
    q: Array | None
    q_alt: Array | None
    cov: Array
    size_ratio: float | None
    reproj_px: float | None
    edge_px: float
    outline: Array
    label: str

    def body(self) -> Optical:
        """The message's `data`. Raises ValueError (pydantic's) for what the wire does not take."""
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = self.cov.tolist()
        return Optical(
            p=tuple(self.p.tolist()),
            q=None if self.q is None else tuple(self.q.tolist()),
            q_alt=None if self.q_alt is None else tuple(self.q_alt.tolist()),
            cov=(xx, xy, xz, yy, yz, zz),
            size_ratio=self.size_ratio,
            reproj_px=self.reproj_px,
            edge_px=self.edge_px,
            frame=self.frame,
        )


def edge_distance(outline: Array, width: int, height: int) -> float:
    """Least distance of points (n, 2), px, to the picture's border; negative outside."""
    return float(min(min(x, y, width - 1 - x, height - 1 - y) for x, y in outline.tolist()))
