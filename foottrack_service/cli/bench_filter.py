"""Part of ``foottrack bench``: what our filter costs, beside filterpy's plain EKF step in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from foottrack_protocol import Message, decode, encode
from foottrack_protocol.messages import Side
from foottrack_service.config import Settings
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.filters import make_filter
from foottrack_service.fusion.foot_filter import warm_up
from foottrack_service.fusion.interface import FootFilter, ImuSample, OpticalFix, Verdict
from foottrack_service.fusion.offline import fuse
from foottrack_service.rotations import Array
from foottrack_service.simulation.scenario import simulate

IMU_HZ = 400.0
USERS = (1, 10)
_FEET = 2
_CAMERA_HZ = 60.0
_SECONDS = 10.0
_BATCH = 50
"""Steps of filterpy between two stretches of ours: a busy machine slows both."""

Call = tuple[ImuSample, None] | tuple[OpticalFix, int]


def filter_costs() -> dict[str, Any]:
    """Medians in us per event of a normal walk at 400 Hz, 30 ms late fixes, and shares of a core. Ten seconds."""
    settings = Settings()
    warm_up()
    calls, inputs, outputs = _walk(settings)
    filter_ = make_filter(settings, "left")
    peer = _filterpy_step()
    imu: list[int] = []
    fixes: list[int] = []
    reads: list[int] = []
    theirs: list[int] = []
    for number, (each, now) in enumerate(calls):
        if isinstance(each, ImuSample):
            imu.append(_timed(lambda each=each: filter_.on_imu(each)))  # type: ignore[misc]
            if number % 2 == 0:
                reads.append(_timed(lambda each=each: filter_.estimate(each.t + 2_000_000)))  # type: ignore[misc]
        else:
            fixes.append(_timed(lambda each=each, now=now: filter_.on_fix(each, now)))  # type: ignore[misc]
        if peer is not None and number % _BATCH == 0:
            theirs += [_timed(peer) for _ in range(5)]
    decodes = [_timed(lambda frames=frames: decode(frames)) for frames in inputs]  # type: ignore[misc]
    encodes = [_timed(lambda message=message: encode(message)) for message in outputs]  # type: ignore[misc]
    costs = {
        "imu_sample": _us(imu),
        "late_fix": _us(fixes),
        "reading": _us(reads),
        "filterpy_ekf_step": _us(theirs) if theirs else None,
        "decode": _us(decodes),
        "encode": _us(encodes),
    }
    filtering = _FEET * (IMU_HZ * _mean(imu) + _CAMERA_HZ * _mean(fixes) + settings.fusion.max_output_hz * _mean(reads))
    messages = sum(decodes) * 1e-9 / _SECONDS + sum(encodes) * 1e-9 / _SECONDS
    shares = {
        str(users): {"filters": _percent(users * filtering), "messages": _percent(users * messages)} for users in USERS
    }
    return {"us": costs, "core_percent_by_users": shares}


def lines(costs: dict[str, Any]) -> list[str]:
    """The same as text."""
    us, shares = costs["us"], costs["core_percent_by_users"]
    peer = us["filterpy_ekf_step"]
    beside = "filterpy is not installed (a development dependency)" if peer is None else f"filterpy's EKF step {peer}"
    ours = f"{us['imu_sample']} an IMU sample, {us['late_fix']} a late fix, {us['reading']} a reading"
    return [
        f"Our filter, us: {ours}; {beside}.",
        f"Messages, us: {us['decode']} to decode one, {us['encode']} to encode one.",
        *(
            f"{users} user{'' if users == '1' else 's'} at {IMU_HZ:g} Hz: {share['filters']} % of a core, and "
            f"{share['messages']} % for messages."
            for users, share in shares.items()
        ),
    ]


def _walk(settings: Settings) -> tuple[list[Call], list[tuple[bytes, bytes]], list[Message]]:
    """The left filter's calls, all messages that come in as frames, and all that go out, of a walk."""
    calls: list[Call] = []

    def make(settings: Settings, side: Side) -> FootFilter:
        filter_ = make_filter(settings, side)
        on_imu, on_fix = filter_.on_imu, filter_.on_fix

        def imu(sample: ImuSample) -> bool:
            calls.append((sample, None))
            return on_imu(sample)

        def fix(fix: OpticalFix, now: int) -> Verdict:
            calls.append((fix, now))
            return on_fix(fix, now)

        if side == "left":
            filter_.on_imu, filter_.on_fix = imu, fix  # type: ignore[method-assign]
        return filter_

    arrivals = [
        each
        for each in simulate("walk", 1, seconds=_SECONDS, imu_hz=IMU_HZ, imu="raw", settings=settings).messages()
        if not each[1].stream.startswith("truth/")
    ]
    outputs = list(fuse(arrivals, FusionCore(settings, make=make)))
    return calls, [encode(message) for _, message in arrivals], outputs


def _filterpy_step() -> Callable[[], object] | None:
    """Nine states, one predict and one update with a position; None without filterpy."""
    try:
        from filterpy.kalman import ExtendedKalmanFilter
    except ImportError:
        return None
    ekf = ExtendedKalmanFilter(dim_x=9, dim_z=3)
    dt = 1.0 / IMU_HZ
    ekf.F = np.eye(9) + dt * np.eye(9, k=3) + 0.5 * dt * dt * np.eye(9, k=6)
    ekf.Q *= 1e-4
    ekf.R *= 1e-4
    H: Array = np.eye(3, 9)
    z = np.zeros((3, 1))

    def step() -> None:
        ekf.predict()
        ekf.update(z, lambda x: H, lambda x: H @ x)

    return step


def _timed(call: Callable[[], object]) -> int:
    began = time.perf_counter_ns()
    call()
    return time.perf_counter_ns() - began


def _us(ns: list[int]) -> float:
    return round(1e-3 * float(np.median(ns)), 2)


def _mean(ns: list[int]) -> float:
    """s; without the one in a hundred that another process interrupted."""
    return 1e-9 * float(np.mean(np.sort(ns)[: max(1, int(0.99 * len(ns)))]))


def _percent(share: float) -> float:
    return round(100.0 * share, 2)
