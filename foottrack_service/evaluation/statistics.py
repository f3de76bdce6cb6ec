"""Figures of a set of errors."""

from __future__ import annotations

import numpy as np

from foottrack_service.rotations import Array


def summary_mm(errors: Array) -> dict[str, float | None]:
    """Mean, median, p95 and max in mm of distances in m, shape (n,). Nil when there are none."""
    if len(errors) == 0:
        return {"mean": None, "median": None, "p95": None, "max": None}
    mm = np.asarray(errors) * 1e3
    return {
        "mean": round(float(np.mean(mm)), 3),
        "median": round(float(np.median(mm)), 3),
        "p95": round(float(np.percentile(mm, 95)), 3),
        "max": round(float(np.max(mm)), 3),
    }
