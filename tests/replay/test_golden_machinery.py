"""The golden machinery itself, on results that are made up."""

from __future__ import annotations

from pathlib import Path

import pytest
from _pytest.outcomes import Failed
from golden import check_golden

from foottrack_protocol import Message
from foottrack_protocol import messages as m


def results(shift: float = 0.0, count: int = 20) -> list[Message]:
    """A head that walks 1 cm a message; from the tenth on it is off by ``shift``."""
    return [
        Message(
            "user",
            "head/pose",
            "fusion",
            "offline",
            n,
            n * 10,
            n * 10,
            True,
            m.HeadPose(p=(0.0, 1.6, -0.01 * n - (shift if n >= 10 else 0.0)), q=(0.0, 0.0, 0.0, 1.0), tracked=True),
        )
        for n in range(count)
    ]


def test_unchanged_results_pass(tmp_path: Path) -> None:
    check_golden("walk", results(), True, tmp_path)
    check_golden("walk", results(), False, tmp_path)
    check_golden("walk", results(shift=1e-9), False, tmp_path)


def test_a_change_names_the_first_field_that_moved(tmp_path: Path) -> None:
    check_golden("walk", results(), True, tmp_path)
    with pytest.raises(Failed) as caught:
        check_golden("walk", results(shift=0.002), False, tmp_path)
    text = str(caught.value)
    assert "user/head/pose, message 10" in text
    assert "data.p.2" in text
    assert "10 messages, by at most 0.002" in text
    assert "--update-golden" in text


def test_missing_and_added_results_are_named(tmp_path: Path) -> None:
    check_golden("walk", results(), True, tmp_path)
    with pytest.raises(Failed, match="1 only golden"):
        check_golden("walk", results(count=19), False, tmp_path)
    with pytest.raises(Failed, match="1 only now"):
        check_golden("walk", results(count=21), False, tmp_path)


def test_without_a_golden_file_it_fails_and_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(Failed, match="--update-golden"):
        check_golden("walk", results(), False, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_only_an_explicit_update_changes_the_file(tmp_path: Path) -> None:
    check_golden("walk", results(), True, tmp_path)
    before = (tmp_path / "walk.results.mcap").read_bytes()
    with pytest.raises(Failed):
        check_golden("walk", results(shift=1.0), False, tmp_path)
    assert (tmp_path / "walk.results.mcap").read_bytes() == before
    check_golden("walk", results(shift=1.0), True, tmp_path)
    check_golden("walk", results(shift=1.0), False, tmp_path)
