"""Numba for the few inner loops that numpy is too slow for: 16 x 16 matrices, 400 times a second and foot.

The first start on a machine compiles them (``warm_up`` in foot_filter says so); later starts read the cache.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """The function, compiled at its first call. IEEE rules are kept: the same input gives the same bits."""
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))
