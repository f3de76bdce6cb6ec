"""What comes when it always does, and what does not: a clock that jumped."""

from __future__ import annotations

import pytest

from foottrack_service.fusion.punctuality import Punctuality

MS = 1_000_000
PICTURE = 16 * MS


def strange(source: Punctuality, frm_s: float, to_s: float, age_ms: float) -> list[bool]:
    return [
        source.is_strange(now - round(age_ms * MS), now)
        for now in range(round(frm_s * 1e9), round(to_s * 1e9), PICTURE)
    ]


@pytest.mark.parametrize("jump_ms", [50.0, -50.0, 250.0])
def test_a_clock_that_jumps_is_strange_until_it_is_back(jump_ms: float) -> None:
    camera = Punctuality()
    assert not any(strange(camera, 0.0, 10.0, 30.0))
    assert all(strange(camera, 10.0, 11.0, 30.0 + jump_ms))
    assert not any(strange(camera, 11.0, 12.0, 30.0))


def test_a_camera_that_stays_later_is_usual_soon_and_its_old_age_still_is() -> None:
    camera = Punctuality()
    strange(camera, 0.0, 60.0, 30.0)
    later = strange(camera, 60.0, 70.0, 130.0)
    assert later[0] and not later[-1]
    assert 2.0 < PICTURE * 1e-9 * sum(later) < 4.0
    assert not any(strange(camera, 70.0, 71.0, 30.0))


def test_little_jitter_is_usual() -> None:
    camera = Punctuality()
    for i in range(600):
        assert not camera.is_strange(i * PICTURE - (20 + 7 * (i % 5)) * MS, i * PICTURE)


def test_what_is_older_than_what_came_before_is_out_of_turn() -> None:
    camera = Punctuality()
    assert not camera.is_out_of_turn(100 * MS, 130 * MS)
    assert not camera.is_out_of_turn(100 * MS, 131 * MS)
    assert camera.is_out_of_turn(50 * MS, 140 * MS)
    assert not camera.is_out_of_turn(116 * MS, 150 * MS)


def test_a_stamp_from_the_future_does_not_shut_out_what_follows() -> None:
    camera = Punctuality()
    assert not camera.is_out_of_turn(10_000 * MS, 130 * MS)
    assert not camera.is_out_of_turn(131 * MS, 160 * MS)
