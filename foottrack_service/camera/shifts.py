"""Who looks at the pictures: a thread that gives way to everybody while cores are free, an ordinary one while not.

A picture keeps a core for a slice of the scheduler's, and an IMU's sample that wakes somebody on that core waits for as
long. A thread of Linux's idle class is thrown out at once instead; but beside busy cores it hardly runs at all, and it
may not leave its class without a privilege, so another thread takes its place. Elsewhere than on Linux nothing is done.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path

PERIOD_S = 0.25
"""Between two looks at the cores."""
FEW_CORES, ENOUGH_CORES = 0.3, 0.6
"""Free ones, of which pictures take up to a quarter: with fewer than the first nobody gives way."""
ENOUGH_FOR_S = 10.0
"""Who does not give way any more does again when the second were free for so long: a game's load comes and goes."""


class Manners:
    """Whether to give way, by how many cores were free in each period."""

    def __init__(self) -> None:
        self.giving_way = False
        self._enough_s = ENOUGH_FOR_S - PERIOD_S

    def see(self, free_cores: float) -> None:
        """Another period is over."""
        self._enough_s = self._enough_s + PERIOD_S if free_cores >= ENOUGH_CORES else 0.0
        self.giving_way = free_cores >= FEW_CORES if self.giving_way else self._enough_s >= ENOUGH_FOR_S


class FreeCores:
    """How many cores were free since the last look, by a file like Linux's ``/proc/stat``.

    Of those that this process may use: a container or ``taskset`` may leave it few of an idle machine's.
    """

    def __init__(self, stat: Path = Path("/proc/stat"), cores: Collection[int] | None = None) -> None:
        self._stat = stat
        self._cores = frozenset(f"cpu{core}" for core in (_allowed() if cores is None else cores))
        self._idle = self._all = 0
        self.look()

    def look(self) -> float | None:
        """None where nobody knows, or where no time has passed."""
        try:
            lines = [line.split() for line in self._stat.read_text("ascii").splitlines() if line.startswith("cpu")]
            # user, nice, system, idle, waiting for a disk, interrupts (2), stolen by other virtual machines
            ticks = [[int(count) for count in line[1:9]] for line in lines if line[0] in self._cores]
        except (OSError, ValueError):
            return None
        if not ticks or min(map(len, ticks)) < 8:
            return None
        idle, total = sum(each[3] + each[4] for each in ticks) - self._idle, sum(map(sum, ticks)) - self._all
        self._idle, self._all = self._idle + idle, self._all + total
        return len(ticks) * idle / total if total > 0 else None


def in_shifts(
    work: Callable[[Callable[[], bool]], None],
    stopped: Callable[[float], bool],
    free_cores: Callable[[], float | None] | None = None,
) -> None:
    """Have ``work`` done, by one thread at a time, until ``stopped`` (it waits for that many s at most) says so.

    ``work`` goes on until what it is given says that its time is over. Raises what it raises.
    """
    look, manners = free_cores or FreeCores().look, Manners()
    stop = False
    while not stop:
        giving_way = manners.giving_way
        over, errors = threading.Event(), list[BaseException]()
        thread = threading.Thread(target=_shift, args=(work, over.is_set, errors, giving_way), name="pictures")
        thread.start()
        try:
            while thread.is_alive() and not stop and manners.giving_way == giving_way:
                stop = stopped(PERIOD_S)
                free = look()
                if free is not None:
                    manners.see(free)
        finally:
            over.set()
            thread.join()
        if errors:
            raise errors[0]


def _shift(
    work: Callable[[Callable[[], bool]], None],
    over: Callable[[], bool],
    errors: list[BaseException],
    giving_way: bool,
) -> None:
    if sys.platform == "linux":
        # Of the calling thread alone. In a batch a picture that comes throws nobody out, and waits for its turn.
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_IDLE if giving_way else os.SCHED_BATCH, os.sched_param(0))
    try:
        work(over)
    except BaseException as error:  # told by whoever waits for the thread
        errors.append(error)


def _allowed() -> Collection[int]:
    if sys.platform == "linux":
        return os.sched_getaffinity(0)
    return range(os.cpu_count() or 1)
