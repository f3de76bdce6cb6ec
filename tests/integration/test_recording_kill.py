"""A recorder that is killed without warning loses at most the last second."""

from __future__ import annotations

import random
from pathlib import Path

from recorder_kills import kill_some

SECOND = 1.0


def test_a_kill_at_any_moment_loses_at_most_the_last_second(tmp_path: Path) -> None:
    rng = random.Random(7)
    kills = kill_some(tmp_path, [0.0, *(rng.uniform(0.3, 3.0) for _ in range(3))])
    assert all(kill.right for kill in kills)
    assert [kill for kill in kills if kill.lost_s > SECOND] == []
    assert sum(kill.recovered for kill in kills) > 0
