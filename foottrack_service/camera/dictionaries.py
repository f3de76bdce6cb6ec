"""Which patterns are tags: OpenCV's dictionaries by name, generated ones, and ones written out in the settings.

A *spec* is one of

- ``"DICT_4X4_50"`` and every other ``DICT_*`` of OpenCV, ArUco or AprilTag;
- ``"GENERATED_3X3_4"``: 4 tags of 3x3 cells, the same on every machine and with every version of OpenCV, since
  what is printed outlives what printed it;
- a list of equally long strings of ``0`` (black) and ``1`` (white), one per tag, row by row: custom tags.

Fewer cells are larger cells: at the same printed size they are what survives motion blur and distance.
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Bits = npt.NDArray[np.uint8]
"""(n, n) cells of one tag without its border, 1 = white."""

DEFAULT_DICTIONARY = "DICT_4X4_50"
DictionarySpec = str | Sequence[str]

_GENERATED = re.compile(r"GENERATED_(\d)X(\d)_(\d{1,3})")


def load_dictionary(spec: DictionarySpec) -> Any:
    """The `cv2.aruco.Dictionary` of a spec. Raises ValueError, naming what would be right."""
    if not isinstance(spec, str):
        return _from_bits([parse_bits(row) for row in spec])
    if spec.startswith("DICT_"):
        number = getattr(cv2.aruco, spec, None)
        if number is None:
            known = ", ".join(predefined_names())
            raise ValueError(f"OpenCV {cv2.__version__} has no dictionary {spec}; it has {known}")
        return cv2.aruco.getPredefinedDictionary(number)
    match = _GENERATED.fullmatch(spec)
    if match is None or match[1] != match[2]:
        raise ValueError(f"{spec!r} is neither DICT_* of OpenCV nor GENERATED_<n>X<n>_<count>, such as GENERATED_3X3_4")
    return _from_bits(generate_tags(int(match[1]), int(match[3])))


def predefined_names() -> list[str]:
    """The names of OpenCV's own dictionaries."""
    return sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))


def parse_bits(text: str) -> Bits:
    """Cells of a custom tag from its row-by-row string. Raises ValueError when it is no square of 0 and 1."""
    side = math.isqrt(len(text))
    if side < 2 or side * side != len(text) or set(text) - {"0", "1"}:
        raise ValueError(f"a custom tag is a square of 0 and 1, row by row, not {text!r}")
    return np.array([int(cell) for cell in text], dtype=np.uint8).reshape(side, side)


def tag_cells(dictionary: Any, tag_id: int) -> Bits:
    """Cells of a tag with its black border of one cell, shape (n + 2, n + 2), 1 = white. Raises ValueError."""
    count, side = len(dictionary.bytesList), int(dictionary.markerSize)
    if not 0 <= tag_id < count:
        raise ValueError(f"the dictionary has ids 0 to {count - 1}, not {tag_id}")
    bits = cv2.aruco.Dictionary.getBitsFromByteList(dictionary.bytesList[tag_id : tag_id + 1], side)
    return np.pad(np.asarray(bits, dtype=np.uint8).reshape(side, side), 1)


def generate_tags(side: int, count: int) -> list[Bits]:
    """`count` tags of side x side cells, as far apart (Hamming, over all turns) as a greedy search finds.

    A tag also differs from its own turns by that distance, and has both colours in fair shares. Raises ValueError
    when there is no such set.
    """
    if not 2 <= side <= 7 or count < 1:
        raise ValueError("generated tags have 2 to 7 cells a side and there is at least one")
    pool = _candidates(side)
    turned = np.stack([[np.rot90(tag, turn).ravel() for turn in range(4)] for tag in pool])
    own = np.min(np.sum(turned[:, :1] != turned[:, 1:], axis=2), axis=1)
    for distance in range(side * side, 0, -1):
        chosen: list[int] = []
        near = own < distance
        while len(chosen) < count and not near.all():
            best = int(np.argmin(near))
            chosen.append(best)
            near = near | np.any(np.sum(turned[:, 0, None] != turned[best], axis=2) < distance, axis=1)
        if len(chosen) == count:
            return [pool[index] for index in chosen]
    raise ValueError(f"there are no {count} distinguishable tags of {side}x{side} cells")


def _candidates(side: int) -> list[Bits]:
    cells = side * side
    every = range(1 << cells) if cells <= 9 else None
    # `random` promises the same bits in every version of Python; numpy's generators do not.
    source = random.Random(side)
    codes = every or [source.getrandbits(cells) for _ in range(3000)]
    tags = [np.array([code >> i & 1 for i in range(cells)], dtype=np.uint8).reshape(side, side) for code in codes]
    return [tag for tag in tags if 0.3 <= tag.mean() <= 0.7]


def _from_bits(tags: Sequence[Bits]) -> Any:
    sides = {tag.shape[0] for tag in tags}
    if len(sides) != 1:
        raise ValueError("custom tags must all have the same number of cells, and there must be one")
    turned = [[np.rot90(tag, turn) for turn in range(4)] for tag in tags]
    gaps = [
        int(np.sum(tag != other))
        for i, tag in enumerate(tags)
        for j, turns in enumerate(turned)
        for turn, other in enumerate(turns)
        if i < j or (i == j and turn > 0)
    ]
    if min(gaps) == 0:
        raise ValueError("two custom tags are the same, or one looks the same after a turn")
    packed = np.concatenate([cv2.aruco.Dictionary.getByteListFromBits(tag) for tag in tags])
    return cv2.aruco.Dictionary(packed, sides.pop(), (min(gaps) - 1) // 2)
