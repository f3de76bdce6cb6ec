"""Places with a rotation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foottrack_service import rotations, unity_axes
from foottrack_service.rotations import Array


class Rigid(NamedTuple):
    """``p`` (3,) m and unit ``q`` (4,), body to parent."""

    p: Array
    q: Array

    def then(self, child: Rigid) -> Rigid:
        """A place that is given in this body's frame, in this body's parent's."""
        return Rigid(self.p + rotations.rotate(self.q, child.p), rotations.multiply(self.q, child.q))

    def inverse(self) -> Rigid:
        """The parent in the body's frame."""
        back = rotations.conjugate(self.q)
        return Rigid(-rotations.rotate(back, self.p), back)


NOWHERE = Rigid(np.zeros(3), rotations.IDENTITY)
"""The parent itself."""


def rigid(p: npt.ArrayLike, q: npt.ArrayLike) -> Rigid:
    """Normalises ``q``. Raises ValueError where a value is not finite, or ``q`` is zero."""
    place = np.asarray(p, dtype=np.float64)
    if not np.all(np.isfinite(place)):
        raise ValueError("a position is not finite")
    return Rigid(place, rotations.normalised(q))


def mirrored(place: Rigid) -> Rigid:
    """Unity's axes to the wire's, and back."""
    return Rigid(np.array(unity_axes.position(place.p)), np.array(unity_axes.rotation(place.q)))
