"""The latency between head and camera stamps: found in the simulation, and refused where nothing determines it."""

from __future__ import annotations

import numpy as np
import pytest

from foottrack_service.headset.latency import Fixes, HeadTrack, Unobservable, head_against_camera
from foottrack_service.simulation.scenario import simulate


def measured(task: str, head_late_s: float) -> tuple[HeadTrack, list[Fixes]]:
    messages = [message for _, message in simulate(task, 2, seconds=12.0, left_imu=False, right_imu=False).messages()]
    heads = [message for message in messages if message.stream == "head/pose"]
    head = HeadTrack(
        np.array([message.t for message in heads]) + round(head_late_s * 1e9),
        np.array([message.data.p for message in heads]),
        np.array([message.data.q for message in heads]),
    )
    tags = []
    for side in ("left", "right"):
        sights = [message for message in messages if message.stream == f"marker/{side}"]
        tags.append(Fixes(np.array([m.t for m in sights]), np.array([m.data.p for m in sights])))
    return head, tags


@pytest.mark.parametrize("late_ms", [-20.0, 0.0, 12.5, 60.0])
def test_it_is_found_to_a_millisecond_or_two(late_ms: float) -> None:
    found = head_against_camera(*measured("head-moving", 1e-3 * late_ms))
    assert found.seconds == pytest.approx(1e-3 * late_ms, abs=2e-3)
    assert 0.0 < found.sigma < 2e-3
    assert found.spread < 0.02


def test_a_head_that_does_not_turn_says_nothing() -> None:
    with pytest.raises(Unobservable, match="look left and right"):
        head_against_camera(*measured("still", 0.0))


def test_beyond_its_range_it_says_nothing() -> None:
    with pytest.raises(Unobservable, match="stand still"):
        head_against_camera(*measured("head-moving", 0.3))


def test_few_sights_say_nothing() -> None:
    head, tags = measured("head-moving", 0.0)
    with pytest.raises(Unobservable, match="at least 60"):
        head_against_camera(head, [Fixes(tag.t[:20], tag.p[:20]) for tag in tags])
