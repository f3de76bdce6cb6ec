"""What a shoe carries: one tag, or several that are seen as one rigid target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from foottrack_service import rotations
from foottrack_service.rotations import Array


@dataclass(frozen=True)
class Tag:
    """A square tag of `size` m (black edge to black edge) at `p`, `q` in its target's frame."""

    id: int
    size: float
    p: tuple[float, float, float] = (0.0, 0.0, 0.0)
    q: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def corners(self) -> Array:
        """(4, 3) m in the target's frame, in OpenCV's order: from the tag's top left clockwise."""
        half = 0.5 * self.size
        square = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
        return np.asarray(rotations.rotate(rotations.normalised(self.q), square) + np.asarray(self.p))


@dataclass(frozen=True)
class Target:
    """The tags of one side. Raises ValueError for no tag, a repeated id, or a size that cannot be."""

    side: str
    tags: tuple[Tag, ...]
    corners: dict[int, Array] = field(init=False, repr=False, compare=False)
    """Per tag id the (4, 3) corners in the target's frame."""
    centres: dict[int, Array] = field(init=False, repr=False, compare=False)
    """Per tag id its centre (3,) there."""
    turns: dict[int, Array] = field(init=False, repr=False, compare=False)
    """Per tag id its rotation (3, 3), tag to target."""
    sizes: dict[int, float] = field(init=False, repr=False, compare=False)
    """Per tag id its size, m."""
    smallest: float = field(init=False, repr=False, compare=False)
    """Size of the smallest tag, m."""
    radius: float = field(init=False, repr=False, compare=False)
    """Largest distance of a corner from the target's origin, m."""

    def __post_init__(self) -> None:
        ids = [tag.id for tag in self.tags]
        if not ids or len(set(ids)) != len(ids):
            raise ValueError(f"the {self.side} target needs tags with different ids, not {ids}")
        if not all(0.0 < tag.size < 1.0 for tag in self.tags):
            raise ValueError(f"tag sizes of the {self.side} target are in metres, above 0 and below 1")
        object.__setattr__(self, "corners", {tag.id: tag.corners() for tag in self.tags})
        object.__setattr__(self, "centres", {tag.id: np.array(tag.p) for tag in self.tags})
        turns = {tag.id: rotations.to_matrix(rotations.normalised(tag.q)) for tag in self.tags}
        object.__setattr__(self, "turns", turns)
        object.__setattr__(self, "sizes", {tag.id: tag.size for tag in self.tags})
        object.__setattr__(self, "smallest", min(tag.size for tag in self.tags))
        reach = max(np.linalg.norm(corners, axis=1).max() for corners in self.corners.values())
        object.__setattr__(self, "radius", float(reach))


def owners(targets: Sequence[Target]) -> Mapping[int, Target]:
    """Which target has which tag id. Raises ValueError when two want the same."""
    owner: dict[int, Target] = {}
    for target in targets:
        for tag in target.tags:
            if tag.id in owner:
                raise ValueError(f"tag {tag.id} is on the {owner[tag.id].side} and on the {target.side} target")
            owner[tag.id] = target
    return owner
