"""[B]'s text format: values by hand, settings, damage."""

from __future__ import annotations

import math

import pytest

from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_service.imu.formats.ascii import AsciiDecoder


def test_gravity_is_added_in_the_axes_that_the_rotation_gives() -> None:
    # 30 deg about the chip's x: gravity's share on y is sin 30, on z cos 30.
    half = math.radians(15.0)
    text = f"1000,L,0.5,0.0,-1.0;1000,R,{math.cos(half):.6f},{math.sin(half):.6f},0,0;"
    (sample,) = AsciiDecoder().feed(text.encode())
    assert sample.ticks == 1000
    assert sample.acc == pytest.approx(
        (0.5, STANDARD_GRAVITY * 0.5, STANDARD_GRAVITY * math.sqrt(0.75) - 1.0), abs=1e-4
    )
    assert sample.q == pytest.approx((math.sin(half), 0.0, 0.0, math.cos(half)), abs=1e-6)
    assert sample.gyro is None


def test_the_rotation_is_normalised() -> None:
    (sample,) = AsciiDecoder().feed(b"5,R,1.02,0,0,0;5,L,0,0,0;")
    assert sample.q == (0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("order", ["LR", "RL"])
def test_either_may_come_first_and_lines_may_be_broken(order: str) -> None:
    messages = {"L": "20,L,1,2,3;\r\n", "R": "24,R,1,0,0,0;\r\n"}
    (sample,) = AsciiDecoder().feed("".join(messages[kind] for kind in order).encode())
    assert sample.ticks == 20
    assert sample.acc == pytest.approx((1.0, 2.0, 3.0 + STANDARD_GRAVITY))


def test_reports_of_different_times_are_no_pair() -> None:
    decoder = AsciiDecoder()
    assert decoder.feed(b"10000,L,1,1,1;") == []
    # Its rotation was lost; the next pair is whole.
    assert decoder.feed(b"20000,R,1,0,0,0;") == []
    (sample,) = decoder.feed(b"20010,L,2,2,2;")
    assert sample.acc[0] == 2.0
    assert decoder.drops == {"unpaired": 1}


def test_a_pair_across_the_wrap_of_the_counter() -> None:
    (sample,) = AsciiDecoder().feed(b"4294967295,L,1,1,1;3,R,1,0,0,0;")
    assert sample.ticks == 4294967295


def test_separator_and_unit_are_settings() -> None:
    decoder = AsciiDecoder(separator="|", tick_us=1000.0)
    (sample,) = decoder.feed(b"12|L|1|1|1;12|R|1|0|0|0;")
    assert sample.ticks == 12
    assert decoder.clock is not None
    assert decoder.clock.tick_us == 1000.0
    # At 100 Hz 5 ms apart would be as near to the neighbour's, 4 is a pair.
    assert decoder.feed(b"22|L|1|1|1;27|R|1|0|0|0;") == []
    assert len(decoder.feed(b"32|L|1|1|1;36|R|1|0|0|0;")) == 1


def test_at_a_higher_rate_a_lost_message_does_not_shift_the_pairs() -> None:
    decoder = AsciiDecoder()
    for k in range(20):
        t = 2500 * k
        lost = k == 10
        samples = decoder.feed((b"" if lost else b"%d,L,%d,0,0;" % (t, k)) + b"%d,R,1,0,0,0;" % t)
        assert [sample.ticks for sample in samples] == ([] if lost else [t])
    assert decoder.drops == {"unpaired": 1}


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (b"1,L,nan,0,0;", "syntax"),
        (b"1,L,inf,0,0;", "syntax"),
        (b"1,L,1_0,0,0;", "syntax"),
        (b"1,L,1e9,0,0;", "range"),
        (b"1,L,1,0;", "syntax"),
        (b"-1,L,1,0,0;", "syntax"),
        (b"1,Q,1,0,0;", "syntax"),
        (b"1,R,0,0,0,0;", "quaternion"),
        (b"1,R,0.5,0,0,0;", "quaternion"),
        (b"1,R,1e99,0,0,0;", "quaternion"),
        (b"1,L," + b"0" * 300 + b",0,0;", "overlong"),
    ],
)
def test_what_is_damaged_is_counted_by_reason(message: bytes, reason: str) -> None:
    decoder = AsciiDecoder()
    assert decoder.feed(message) == []
    assert decoder.drops == {reason: 1}
