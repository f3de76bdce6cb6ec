"""Acceleration and rotation that come in separate reports, put together."""

from __future__ import annotations

from collections import Counter
from typing import Any


class Pairing:
    """Joins one report of each kind whose keys (times or cycle numbers, modulo ``modulus``) are close enough.

    Nothing waits for a timer: a set is complete with its last report, and what found no partner is dropped (counted
    as ``unpaired``) when a newer report shows that its partner is not coming.
    """

    def __init__(self, kinds: tuple[str, ...], modulus: int, tolerance: int, drops: Counter[str]) -> None:
        self._kinds = kinds
        self._modulus = modulus
        self.tolerance = tolerance
        self._drops = drops
        self._pending: dict[str, tuple[int, Any]] = {}

    def add(self, kind: str, key: int, report: Any) -> dict[str, tuple[int, Any]] | None:
        """The complete set as {kind: (key, report)}, or None while parts are missing."""
        if kind in self._pending:
            self._drops["unpaired"] += 1
        self._pending[kind] = (key, report)
        half = self._modulus // 2
        for other, (other_key, _) in list(self._pending.items()):
            newer_by = (key - other_key + half) % self._modulus - half
            if abs(newer_by) > self.tolerance:
                self._drops["unpaired"] += 1
                if newer_by < 0:
                    del self._pending[kind]
                    return None
                del self._pending[other]
        if len(self._pending) < len(self._kinds):
            return None
        complete, self._pending = self._pending, {}
        return complete

    def clear(self) -> None:
        """Forget what waits for a partner."""
        self._pending.clear()
