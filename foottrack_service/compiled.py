"""Numba for the few inner loops that numpy is too slow for: 16 x 16 matrices, 400 times a second and foot.

The first start on a machine compiles them (a room's ``warm_up`` says so); later starts read the cache.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import platformdirs

_ROOMS = ("camera", "fusion")
"""Which have kernels."""
_FEED_KERNELS = ("foot_filter_doubt.py", "foot_filter_events.py", "foot_filter_memory.py", "interface.py")
"""Files without kernels, whose constants are compiled into some."""

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """The function, compiled at its first call. IEEE rules are kept: the same input gives the same bits.

    Uncompiled it gives them too, as long as it uses neither ``math.hypot`` nor ``** 2`` on what varies.

    Loops copy arrays: for ``a[:] = b`` numba compiles its message about shapes that differ, which takes five seconds.
    """
    config: Any = numba.config
    before = config.CACHE_DIR
    config.CACHE_DIR = before or _CACHE
    try:
        return cast(F, numba.njit(cache=True, error_model="numpy")(function))
    finally:
        config.CACHE_DIR = before


def is_compiled(kernel: Callable[..., Any]) -> bool:
    """Whether this machine has compiled this kernel of this version before, or never will (NUMBA_DISABLE_JIT)."""
    if compiling_is_off():
        return True
    dispatcher: Any = kernel
    function = dispatcher.py_func
    index = f"{Path(function.__code__.co_filename).stem}.{function.__qualname__}-*.nbi"
    return any(Path(dispatcher._cache.cache_path).glob(index))


def compiling_is_off() -> bool:
    """Whether NUMBA_DISABLE_JIT leaves all kernels to Python."""
    config: Any = numba.config
    return bool(config.DISABLE_JIT)


def _cache_folder() -> str:
    # Numba renews a function's cache when its own file changes, but not when a constant or a function that it takes
    # from another file does: so the cache is named by all files that have or feed kernels.
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for file in sorted(file for room in _ROOMS for file in (here / room).glob("*.py")):
        text = file.read_bytes()
        if b"@compiled" in text or file.name in _FEED_KERNELS:
            digest.update(text)
    return str(Path(platformdirs.user_cache_dir("foottrack", appauthor=False)) / f"kernels-{digest.hexdigest()[:16]}")


_CACHE = _cache_folder()
