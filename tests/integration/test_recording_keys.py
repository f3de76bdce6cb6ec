"""Keys of a real terminal, as far as a pseudo-terminal is one."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest

from foottrack_service.cli.keys import keys, split_keys

Run = Callable[[Coroutine[Any, Any, Any]], Any]


def test_escape_sequences_are_arrows_and_the_rest_is_itself() -> None:
    assert split_keys("a\x1b[C\x1b[D +\x1b[A\x1b[B") == ["a", "right", "left", " ", "+", "up", "down"]
    assert split_keys("\x1b") == ["\x1b"]
    assert split_keys("") == []


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX")
def test_keys_arrive_in_the_event_loop_and_the_terminal_is_as_before(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, slave = os.openpty()
    with os.fdopen(master, "rb+", buffering=0), os.fdopen(slave, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        before = termios.tcgetattr(terminal)

        async def scenario() -> list[str]:
            got: list[str] = []
            done = asyncio.Event()

            def handle(key: str) -> None:
                got.append(key)
                if key == "q":
                    done.set()

            with keys(handle) as reading:
                assert reading
                os.write(master, b" \x1b[Cq")
                await done.wait()
            return got

        assert run(scenario()) == [" ", "right", "q"]
        assert termios.tcgetattr(terminal) == before


def test_without_a_terminal_no_keys_are_read(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> bool:
        with Path(os.devnull).open() as nothing:  # noqa: ASYNC230 it never waits
            monkeypatch.setattr(sys, "stdin", nothing)
            with keys(lambda _key: None) as reading:
                return reading

    assert run(scenario()) is False
