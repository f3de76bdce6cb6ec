"""Processes that share the evaluation's work."""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

MOST = 61
"""Windows can wait for no more at a time, and ProcessPoolExecutor refuses more there."""


def processes(jobs: int) -> ProcessPoolExecutor:
    """As many as there are cores, or jobs. Spawned, as everywhere on Windows."""
    return ProcessPoolExecutor(min(max(jobs, 1), os.cpu_count() or 1, MOST), mp_context=get_context("spawn"))
