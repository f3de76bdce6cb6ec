"""Which format a stream of bytes is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from foottrack_service.imu.formats import SERIAL_FORMATS
from foottrack_service.imu.formats.shtp import ShtpReceiver

LEAST_MESSAGES = 3
"""So many in a row are no accident: each alone passes a checksum or a grammar."""


def guess_format(data: bytes) -> str | None:
    """The format that finds most of its messages in these bytes, and more of them than damage; None if none does.

    A BNO08x in UART-SHTP shows by its cargoes: it says three of them after a reset, and no sample before it is told.
    """
    found = {name: count(data) for name, count in _COUNTERS.items()}
    best = max(found, key=lambda name: found[name])
    return best if found[best] >= LEAST_MESSAGES else None


def _samples(name: str) -> Callable[[bytes], int]:
    def count(data: bytes) -> int:
        decoder = SERIAL_FORMATS[name].decoder()
        samples = len(decoder.feed(data))
        damaged = sum(number for reason, number in decoder.drops.items() if reason not in ("garbage", "lost"))
        return samples if samples > damaged else 0

    return count


def _cargoes(data: bytes) -> int:
    drops: Counter[str] = Counter()
    cargoes = sum(1 for _ in ShtpReceiver(drops).feed(data))
    damaged = sum(number for reason, number in drops.items() if reason not in ("lost", "fragment"))
    return cargoes if cargoes > damaged else 0


_COUNTERS = {name: _cargoes if name == "bno08x" else _samples(name) for name in SERIAL_FORMATS}
