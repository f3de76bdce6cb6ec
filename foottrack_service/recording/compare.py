"""Compares two recordings, or results with golden ones, field by field, and names the first that moved.

The n-th message of a topic is compared with the other side's n-th of that topic, as maps: what the order between
topics was does not matter, a key that is nil may also be absent, and an integer may stand where a float does.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import msgpack

from foottrack_service.recording.recording import Frame


class Tolerance(NamedTuple):
    """Floats are the same when they differ by at most ``absolute + relative * |a|``; integers when they are equal."""

    absolute: float = 0.0
    relative: float = 0.0


EXACT = Tolerance()


@dataclass(frozen=True, slots=True)
class Divergence:
    """One field of one message."""

    topic: str
    index: int
    """Which message of the topic, from 0."""
    arrival: int
    """Of the first side's message, or of the second's where the first has none; ns."""
    field: str
    """As ``data.left.ankle.p.0``; empty where a whole message is missing on one side."""
    a: Any
    b: Any

    def __str__(self) -> str:
        place = f"{self.topic}, message {self.index} (arrived at {self.arrival} ns)"
        if not self.field:
            return f"{place}: only in {'A' if self.b is None else 'B'}"
        return f"{place}, {self.field}: {self.a!r} in A, {self.b!r} in B"


@dataclass(slots=True)
class FieldMoves:
    """How one field of one topic differs."""

    messages: int = 0
    largest: float = 0.0
    """Largest difference of numbers, in the field's unit."""


@dataclass(slots=True)
class Comparison:
    """What a comparison found."""

    compared: int = 0
    """Pairs of messages."""
    only_a: int = 0
    only_b: int = 0
    first: Divergence | None = None
    """In order of arrival on the first side."""
    moved: dict[str, FieldMoves] = field(default_factory=dict)
    """By ``<topic> <field>``."""

    @property
    def same(self) -> bool:
        """Whether nothing differs."""
        return self.first is None


def compare(
    a: Iterable[Frame], b: Iterable[Frame], tolerance: Tolerance = EXACT, ignore: Sequence[str] = ()
) -> Comparison:
    """Compare two streams of frames. ``ignore`` has patterns of fields (``sid``, ``data.*.sigma``).

    ``log_time``, the arrival, is a field as any other. Raises ValueError for a payload that is no msgpack map.
    """
    result = Comparison()
    waiting: dict[bytes, deque[Frame]] = {}
    index: dict[bytes, int] = {}
    others = iter(b)
    for frame in a:
        number = index[frame.topic] = index.get(frame.topic, -1) + 1
        partner = _next_of(frame.topic, others, waiting)
        if partner is None:
            result.only_a += 1
            _note(result, frame, number, "", frame.payload, None)
            continue
        result.compared += 1
        if frame != partner:
            for name, left, right in _differences(_fields(frame), _fields(partner), "", tolerance):
                if not any(fnmatchcase(name, pattern) for pattern in ignore):
                    _note(result, frame, number, name, left, right)
    for left_over in [*(frame for queue in waiting.values() for frame in queue), *others]:
        number = index[left_over.topic] = index.get(left_over.topic, -1) + 1
        result.only_b += 1
        _note(result, left_over, number, "", None, left_over.payload)
    return result


def _next_of(topic: bytes, frames: Iterator[Frame], waiting: dict[bytes, deque[Frame]]) -> Frame | None:
    queue = waiting.get(topic)
    if queue:
        return queue.popleft()
    for frame in frames:
        if frame.topic == topic:
            return frame
        waiting.setdefault(frame.topic, deque()).append(frame)
    return None


def _note(result: Comparison, frame: Frame, index: int, name: str, a: Any, b: Any) -> None:
    topic = frame.topic.decode(errors="replace")
    if result.first is None:
        result.first = Divergence(topic, index, frame.arrival, name, a, b)
    if name:
        moves = result.moved.setdefault(f"{topic} {name}", FieldMoves())
        moves.messages += 1
        if _is_number(a) and _is_number(b):
            moves.largest = max(moves.largest, abs(a - b))


def _fields(frame: Frame) -> dict[str, Any]:
    try:
        values = msgpack.unpackb(frame.payload)
    except Exception as error:  # msgpack raises a dozen kinds
        raise ValueError(f"{frame.topic!r}: {type(error).__name__}: {error}") from None
    if type(values) is not dict:
        raise ValueError(f"{frame.topic!r}: a map is due, not {type(values).__name__}")
    return {"log_time": frame.arrival, **values}


def _differences(a: Any, b: Any, name: str, tolerance: Tolerance) -> Iterator[tuple[str, Any, Any]]:
    prefix = f"{name}." if name else ""
    if type(a) is dict and type(b) is dict:
        for key in [*a, *(key for key in b if key not in a)]:
            yield from _differences(a.get(key), b.get(key), f"{prefix}{key}", tolerance)
    elif type(a) is list and type(b) is list and len(a) == len(b):
        for index, (left, right) in enumerate(zip(a, b, strict=True)):
            yield from _differences(left, right, f"{prefix}{index}", tolerance)
    elif not _same(a, b, tolerance):
        yield name, a, b


def _same(a: Any, b: Any, tolerance: Tolerance) -> bool:
    if a == b:
        return type(a) is type(b) or (_is_number(a) and _is_number(b))
    if not (_is_number(a) and _is_number(b)) or type(a) is type(b) is int:
        return False
    return bool(abs(a - b) <= tolerance.absolute + tolerance.relative * abs(a))


def _is_number(value: Any) -> bool:
    return type(value) is int or (type(value) is float and math.isfinite(value))
