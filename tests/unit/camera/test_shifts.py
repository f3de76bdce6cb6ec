"""Giving way while cores are free, and not when they are not."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from foottrack_service.camera.shifts import ENOUGH_FOR_S, PERIOD_S, FreeCores, Manners, in_shifts

PERIODS = round(ENOUGH_FOR_S / PERIOD_S)


def test_who_gives_way_stops_at_once_and_begins_again_after_a_while() -> None:
    manners = Manners()
    said = []
    for free in (0.4, 1.5, 0.4, 0.2, *[1.5] * PERIODS, 0.4, 0.0, *[1.5] * (PERIODS - 1), 0.5, *[1.5] * PERIODS):
        manners.see(free)
        said.append(manners.giving_way)
    busy = [False] * (PERIODS - 1)
    #       few, enough, still some, none
    assert said == [False, False, False, False, *busy, True, True, False, *busy, False, *busy, True]


def test_a_machine_with_time_to_spare_is_known_after_one_look() -> None:
    manners = Manners()
    assert not manners.giving_way
    manners.see(1.0)
    assert manners.giving_way


def test_free_cores_are_counted_since_the_last_look(tmp_path: Path) -> None:
    stat = tmp_path / "stat"
    stat.write_text("cpu 0 0 0 0\ncpu0 100 0 100 700 100 0 0 0 0 0\ncpu1 0 0 0 0 0 0 0 0 0 0\nintr 1 2 3\n")
    cores = FreeCores(stat, cores=(0, 1))
    assert cores.look() is None  # no time has passed
    # 20 of 100 ticks of one were idle, 5 more waited for a disk, 15 were stolen; the other was busy all the time.
    stat.write_text("cpu0 150 2 103 720 105 2 3 15 7 7\ncpu1 100 0 0 0 0 0 0 0 0 0\n")
    assert cores.look() == pytest.approx(0.25)
    stat.write_text("cpu0 150 2 103 820 105 2 3 15 7 7\ncpu1 100 0 0 100 0 0 0 0 0 0\n")
    assert cores.look() == pytest.approx(2.0)


def test_cores_that_this_process_may_not_use_are_free_for_others(tmp_path: Path) -> None:
    stat = tmp_path / "stat"
    stat.write_text("cpu 0 0 0 0 0 0 0 0\ncpu0 0 0 0 0 0 0 0 0\ncpu1 0 0 0 0 0 0 0 0\ncpu10 0 0 0 0 0 0 0 0\n")
    cores = FreeCores(stat, cores=(1,))
    stat.write_text("cpu 30 0 0 270 0 0 0 0\ncpu0 0 0 0 100 0 0 0 0\ncpu1 30 0 0 70 0 0 0 0\ncpu10 0 0 0 100 0 0 0 0\n")
    assert cores.look() == pytest.approx(0.7)


@pytest.mark.skipif(sys.platform != "linux", reason="counts by /proc/stat")
def test_the_machine_s_own_file_tells_of_as_many_as_there_are_at_most() -> None:
    cores = FreeCores()
    free = None
    while free is None:  # until a tick has passed
        free = cores.look()
    assert free <= len(os.sched_getaffinity(0))


@pytest.mark.parametrize("text", ["", "cpu", "cpu 1 2 3 4 5 6 7 8", "cpu0 a b c d e f g h", "cpu0 1 2 3"])
def test_where_nobody_knows_nothing_is_said(tmp_path: Path, text: str) -> None:
    (tmp_path / "stat").write_text(text)
    assert FreeCores(tmp_path / "stat", (0,)).look() is None
    assert FreeCores(tmp_path / "absent", (0,)).look() is None


def test_one_thread_relieves_the_other_and_none_is_left() -> None:
    shifts: list[tuple[threading.Thread, int]] = []
    begun = threading.Semaphore(0)
    # Free at the first look, then busy, once the shift has begun that was due for it.
    free = iter([1.5, 0.0, 0.0])

    def work(over: Callable[[], bool]) -> None:
        assert not any(thread.is_alive() for thread, _ in shifts)
        policy = os.sched_getscheduler(0) if sys.platform == "linux" else 0
        shifts.append((threading.current_thread(), policy))
        begun.release()
        while not over():
            threading.Event().wait(1e-3)

    def stopped(_timeout: float) -> bool:
        assert begun.acquire(timeout=10.0)
        return len(shifts) == 3

    in_shifts(work, stopped, lambda: next(free))
    assert len({thread for thread, _ in shifts}) == 3
    assert not any(thread.is_alive() for thread, _ in shifts)
    if sys.platform == "linux":
        assert [policy for _, policy in shifts] == [os.SCHED_BATCH, os.SCHED_IDLE, os.SCHED_BATCH]


def test_an_error_of_the_work_is_raised() -> None:
    def work(_over: Callable[[], bool]) -> None:
        raise EOFError("no more pictures")

    with pytest.raises(EOFError, match="no more pictures"):
        in_shifts(work, lambda _timeout: False, lambda: None)


def test_an_error_of_who_stops_it_leaves_no_thread_behind() -> None:
    threads = []

    def work(over: Callable[[], bool]) -> None:
        threads.append(threading.current_thread())
        while not over():
            threading.Event().wait(1e-3)

    def stopped(_timeout: float) -> bool:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        in_shifts(work, stopped, lambda: None)
    assert not any(thread.is_alive() for thread in threads)
