"""Whose tag it is by how it moves: a few pictures decide, and nothing that both feet do, nor a thing that lies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from foottrack_service.fusion.whose_motion import WhoseMotion
from foottrack_service.rotations import Array

PICTURE = 1 / 60


def seen(
    whose: WhoseMotion,
    seconds: float,
    place: Callable[[float], Array],
    ours: bool | None,
    others: bool | None,
    frm: float = 0.0,
    pace: float = PICTURE,
) -> None:
    for t in np.arange(frm, frm + seconds, pace):
        whose.see(round(t * 1e9), "marker", place(t), 0.002, lambda *_: ours, lambda *_: others)


def lies(t: float) -> Array:
    return np.array([0.1, 0.05, -0.2])


def flies(t: float) -> Array:
    return np.array([0.1, 0.05, -0.2 - 1.5 * t])


@pytest.mark.parametrize("pace", [PICTURE, 0.04])
def test_what_lies_while_we_swing_and_the_other_stands_is_the_other_s(pace: float) -> None:
    whose = WhoseMotion()
    seen(whose, 0.2, lies, ours=True, others=False, pace=pace)
    assert whose.is_others and not whose.is_ours


def test_so_is_what_flies_while_we_stand() -> None:
    whose = WhoseMotion()
    seen(whose, 0.2, flies, ours=False, others=True)
    assert whose.is_others


def test_what_flies_while_only_we_swing_is_ours_and_outweighs_what_was_before() -> None:
    whose = WhoseMotion()
    seen(whose, 2.0, lies, ours=True, others=False)
    assert whose.is_others
    seen(whose, 0.4, flies, ours=True, others=False, frm=2.0)
    assert whose.is_ours and not whose.is_others


def test_what_lies_while_only_we_stand_may_be_any_tag_on_the_floor() -> None:
    whose = WhoseMotion()
    seen(whose, 1.0, lies, ours=False, others=True)
    assert not whose.is_ours
    seen(whose, 0.3, lies, ours=True, others=False, frm=1.0)
    seen(whose, 0.3, lies, ours=False, others=True, frm=1.3)
    assert not whose.is_others


@pytest.mark.parametrize("both", [True, False, None])
@pytest.mark.parametrize("place", [lies, flies])
def test_what_both_feet_do_says_nothing_and_lets_what_was_known_fade(
    both: bool | None, place: Callable[[float], Array]
) -> None:
    whose = WhoseMotion()
    seen(whose, 1.0, place, ours=both, others=both)
    assert not whose.is_ours and not whose.is_others
    seen(whose, 0.3, lies, ours=True, others=False, frm=1.0)
    assert whose.is_others
    seen(whose, 2.0, lies, ours=False, others=False, frm=1.3)
    assert not whose.is_others


def test_a_false_tag_elsewhere_is_no_motion_of_the_true_one() -> None:
    whose = WhoseMotion()

    def jumps(t: float) -> Array:
        return lies(t) + [0.5 * (round(t / PICTURE) % 5 == 0), 0.0, 0.0]

    seen(whose, 1.0, jumps, ours=True, others=False)
    assert not whose.is_ours


def test_what_was_ours_before_a_hole_need_not_be_now() -> None:
    whose = WhoseMotion()
    seen(whose, 0.3, flies, ours=True, others=False)
    assert whose.is_ours
    seen(whose, 0.05, flies, ours=True, others=False, frm=1.0)
    assert not whose.is_ours
    seen(whose, 0.3, flies, ours=True, others=False, frm=1.1)
    whose.clear()
    assert not whose.is_ours
