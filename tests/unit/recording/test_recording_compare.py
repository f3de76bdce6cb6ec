"""Comparison: the first field that moved, tolerances, and what may be left out."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest
from recording_samples import frames

from foottrack_service.recording.compare import Comparison, Tolerance, compare
from foottrack_service.recording.reader import Frame


def changed(frame: Frame, **values: Any) -> Frame:
    """The frame with envelope keys, or ``data__key`` of the body, replaced."""
    envelope = msgpack.unpackb(frame.payload)
    for name, value in values.items():
        outer, _, inner = name.partition("__")
        if inner:
            envelope[outer][inner] = value
        else:
            envelope[outer] = value
    return frame._replace(payload=msgpack.packb(envelope))


def one(a: dict[str, Any], b: dict[str, Any], **options: Any) -> Comparison:
    return compare([Frame(1, b"u/x", msgpack.packb(a))], [Frame(1, b"u/x", msgpack.packb(b))], **options)


def test_the_same_is_the_same() -> None:
    found = compare(frames(40), frames(40))
    assert found.same
    assert (found.compared, found.only_a, found.only_b, found.moved) == (40, 0, 0, {})


def test_the_first_field_that_moved_is_named() -> None:
    a, b = frames(40), frames(40)
    b[13] = changed(b[13], data__acc=[1.0, 2.0, 3.0])
    b[22] = changed(b[22], valid=False)
    found = compare(a, b)
    assert found.first is not None
    assert (found.first.topic, found.first.index, found.first.field) == ("user/imu/right", 3, "data.acc.0")
    assert found.first.b == 1.0
    assert found.first.arrival == a[13].arrival
    assert "user/imu/right, message 3" in str(found.first)
    assert set(found.moved) == {
        "user/imu/right data.acc.0",
        "user/imu/right data.acc.1",
        "user/imu/right data.acc.2",
        "user/head/pose valid",
    }


def test_the_order_between_topics_does_not_matter_and_within_one_it_does() -> None:
    a = frames(8)
    assert compare(a, [a[1], a[0], *a[2:]]).same
    found = compare(a, [a[4], *a[1:4], a[0], *a[5:]])
    assert found.first is not None
    assert (found.first.index, found.first.field) == (0, "log_time")


def test_what_one_side_lacks_is_counted_and_named() -> None:
    a = frames(40)
    found = compare(a, a[:-1])
    assert (found.only_a, found.only_b, found.compared) == (1, 0, 39)
    assert found.first is not None
    assert str(found.first).endswith("only in A")
    found = compare(a[:-2], a)
    assert (found.only_a, found.only_b) == (0, 2)
    assert found.first is not None
    assert str(found.first).endswith("only in B")
    assert found.first.index == 9


@pytest.mark.parametrize(
    ("a", "b", "tolerance", "same"),
    [
        (1.0, 1.0 + 1e-9, Tolerance(), False),
        (1.0, 1.0 + 1e-9, Tolerance(absolute=1e-8), True),
        (1.0, 1.1, Tolerance(absolute=1e-8), False),
        (1000.0, 1000.5, Tolerance(relative=1e-3), True),
        (1000.0, 1002.0, Tolerance(relative=1e-3), False),
        (1, 1.0, Tolerance(), True),
        (10**15, 10**15 + 1, Tolerance(relative=1e-3), False),
        (True, 1, Tolerance(absolute=5.0), False),
        ("left", "right", Tolerance(absolute=5.0), False),
        (None, 0.0, Tolerance(absolute=5.0), False),
        ([1.0, 2.0], [1.0], Tolerance(absolute=5.0), False),
        ([1.0, 2.0], [1.0, 2.5], Tolerance(absolute=1.0), True),
        ({"p": [0.0]}, None, Tolerance(), False),
    ],
)
def test_tolerances_are_for_floats(a: Any, b: Any, tolerance: Tolerance, same: bool) -> None:
    assert one({"x": a}, {"x": b}, tolerance=tolerance).same is same


def test_nil_and_absent_are_the_same_and_a_new_key_is_not() -> None:
    assert one({"x": None}, {}).same
    assert one({}, {"x": {"y": None}}).first is not None
    assert not one({"x": 1}, {"x": 1, "y": 2}).same


def test_the_largest_difference_of_a_field_is_kept() -> None:
    a = [Frame(n, b"u/x", msgpack.packb({"x": 1.0})) for n in range(3)]
    b = [Frame(n, b"u/x", msgpack.packb({"x": x})) for n, x in enumerate((1.0, 4.0, -1.5))]
    moves = compare(a, b).moved["u/x x"]
    assert (moves.messages, moves.largest) == (2, 3.0)


def test_what_is_ignored_does_not_count() -> None:
    a = frames(40)
    b = [changed(frame, sid="other")._replace(arrival=frame.arrival + 5) for frame in a]
    assert compare(a, b, ignore=["sid", "log_time"]).same
    assert not compare(a, b, ignore=["sid"]).same
    b[0] = changed(b[0], data__acc=[0.0, 0.0, 0.0])
    assert compare(a, b, ignore=["sid", "log_time", "data.acc.*"]).same


def test_what_is_no_map_is_refused() -> None:
    with pytest.raises(ValueError, match="map"):
        compare([Frame(1, b"u/x", b"\x01")], [Frame(1, b"u/x", b"\x02")])
    with pytest.raises(ValueError):
        compare([Frame(1, b"u/x", b"\xc1")], [Frame(1, b"u/x", b"\x02")])
