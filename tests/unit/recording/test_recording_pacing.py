"""The pacing of a replay: what is due when, by arithmetic alone."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_service.recording.reader import Span
from foottrack_service.recording.replay import SLIP_NS, Pacer

S = 1_000_000_000
FIRST, LAST = 100 * S, 160 * S
NOW = 7_000 * S


def pacer(rate: float = 1.0) -> Pacer:
    return Pacer(Span(FIRST, LAST), NOW, rate)


def test_at_rate_one_it_keeps_the_recorded_pace() -> None:
    p = pacer()
    assert p.wait(FIRST, NOW) == 0
    assert p.wait(FIRST + 2 * S, NOW) == 2 * S
    assert p.wait(FIRST + 2 * S, NOW + 2 * S) == 0
    assert p.position(NOW + 5 * S) == FIRST + 5 * S
    assert p.bus_time(FIRST + 3 * S) == NOW + 3 * S


@pytest.mark.parametrize(("rate", "wait"), [(2.0, 5 * S), (0.5, 20 * S), (100.0, S // 10)])
def test_rates_stretch_time(rate: float, wait: int) -> None:
    assert pacer(rate).wait(FIRST + 10 * S, NOW) == wait
    assert pacer(rate).bus_time(FIRST + 10 * S) == NOW + wait


def test_a_pause_holds_the_position_and_resuming_goes_on_from_it() -> None:
    p = pacer()
    p.pause(NOW + 4 * S)
    assert p.wait(FIRST + 4 * S, NOW + 9 * S) is None
    assert p.position(NOW + 9 * S) == FIRST + 4 * S
    p.pause(NOW + 10 * S)
    p.resume(NOW + 20 * S)
    p.resume(NOW + 20 * S)
    assert p.position(NOW + 21 * S) == FIRST + 5 * S
    assert p.wait(FIRST + 6 * S, NOW + 21 * S) == S


def test_a_new_rate_goes_on_from_where_it_is() -> None:
    p = pacer()
    p.set_rate(4.0, NOW + 10 * S)
    assert p.position(NOW + 10 * S) == FIRST + 10 * S
    assert p.position(NOW + 11 * S) == FIRST + 14 * S


def test_a_new_rate_while_paused_does_not_move_it() -> None:
    p = pacer()
    p.pause(NOW + S)
    p.set_rate(4.0, NOW + 10 * S)
    assert p.position(NOW + 11 * S) == FIRST + S
    p.resume(NOW + 12 * S)
    assert p.position(NOW + 13 * S) == FIRST + 5 * S


def test_seeking_moves_the_stamps_with_it_and_stays_inside() -> None:
    p = pacer()
    assert p.seek(FIRST + 30 * S, NOW + S) == FIRST + 30 * S
    assert p.bus_time(FIRST + 31 * S) == NOW + 2 * S
    assert p.wait(FIRST + 30 * S, NOW + S) == 0
    assert p.seek(0, NOW + 2 * S) == FIRST
    assert p.seek(LAST + S, NOW + 2 * S) == LAST
    assert p.position(NOW + 50 * S) == LAST


def test_seeking_while_paused_stays_paused() -> None:
    p = pacer()
    p.pause(NOW)
    p.seek(FIRST + 30 * S, NOW + S)
    assert p.paused
    assert p.position(NOW + 9 * S) == FIRST + 30 * S


def test_far_behind_it_slips_instead_of_rushing() -> None:
    p = pacer()
    late = NOW + 10 * S
    assert p.wait(FIRST, late - 10 * S + SLIP_NS) == 0
    assert p.bus_time(FIRST) == NOW
    assert p.wait(FIRST + S, late) == 0
    assert p.bus_time(FIRST + S) == late
    assert p.wait(FIRST + 2 * S, late) == S


@pytest.mark.parametrize("rate", [0.0, -1.0, 0.001, 1001.0, float("nan"), float("inf")])
def test_rates_that_make_no_sense_are_refused_and_change_nothing(rate: float) -> None:
    with pytest.raises(ValueError, match="rate"):
        pacer(rate)
    p = pacer()
    with pytest.raises(ValueError, match="rate"):
        p.set_rate(rate, NOW)
    assert p.rate == 1.0


@given(
    steps=st.lists(
        st.tuples(st.sampled_from(["pause", "resume", "rate"]), st.integers(0, 3 * S), st.floats(0.1, 10.0)),
        max_size=20,
    )
)
def test_without_seeking_the_position_never_goes_back(steps: list[tuple[str, int, float]]) -> None:
    p, now, before = pacer(), NOW, FIRST
    for what, elapsed, rate in steps:
        now += elapsed
        if what == "rate":
            p.set_rate(rate, now)
        else:
            getattr(p, what)(now)
        assert before <= p.position(now) <= LAST
        before = p.position(now)
