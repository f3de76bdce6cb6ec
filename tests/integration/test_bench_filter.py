"""The filter's part of ``foottrack bench``. Its figures are the machine's; their order and their sums are not."""

from __future__ import annotations

import builtins
from typing import Any

import pytest

from foottrack_service.cli import bench_filter


def test_costs_are_counted_beside_the_peer_s() -> None:
    costs = bench_filter.filter_costs()
    assert all(value is not None and value > 0.0 for value in costs["us"].values())
    one, ten = (costs["core_percent_by_users"][users] for users in ("1", "10"))
    assert ten["filters"] == pytest.approx(10.0 * one["filters"], rel=0.05)
    assert ten["messages"] == pytest.approx(10.0 * one["messages"], rel=0.05)
    assert any("filterpy's EKF step" in line for line in bench_filter.lines(costs))


def test_without_the_peer_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith("filterpy"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.setattr(bench_filter, "_SECONDS", 2.0)
    costs = bench_filter.filter_costs()
    assert costs["us"]["filterpy_ekf_step"] is None
    assert any("not installed" in line for line in bench_filter.lines(costs))
