"""``foottrack bench --camera``: what a camera costs the way from an IMU's bytes to the pose.

Pictures are drawn beforehand, and played from files at a camera's rate. Camera on and off take turns, and each pair
gives a ratio: a machine that is busy with something else slows both of a pair.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import zmq

from foottrack_protocol import Message, decode, encode
from foottrack_protocol.messages import HeadPose, Imu
from foottrack_service.cli.running import CommandFailed, collect_seldom, run_loop
from foottrack_service.config import BusSettings, Settings

PAIRS = 8
FPS = 59.94
"""Never in step with the IMU's 100 Hz: else a picture falls between samples where luck wants it, for a whole phase."""
_PICTURES = 120
_IMU_HZ = 100.0
_TIMEOUT_MS = 5000
_START_S = 120.0
_SETTLE = 60
"""Fixes, or samples, before a phase counts."""


def camera_pairs(seconds: float, report: Callable[[str], None]) -> dict[str, Any]:
    """Milliseconds from writing an IMU's bytes to ``pose/body``, p50 and p99, camera on and off, each for ``seconds``.

    Until it is published, and until a subscriber in another process has it, which shares the cores with all the rest.
    What the service's process spends on a picture shows also where other work hides the rest.
    Raises CommandFailed where there are no ptys.
    """
    if sys.platform == "win32":
        raise CommandFailed("--camera needs ptys, which Windows has not")
    from foottrack_service.imu.devices.plugged import PluggedImu

    with tempfile.TemporaryDirectory(prefix="foottrack-bench-") as folder:
        report("drawing pictures")
        _draw(Path(folder))
        imu = PluggedImu("rvc")
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, folder, imu.port), daemon=False)
        process.start()
        try:
            if not ours.poll(_START_S):
                raise CommandFailed(f"the service did not start within {_START_S:g} s")
            return _measured(BusSettings(**ours.recv()), ours, imu, seconds, report)
        finally:
            ours.send("stop")
            process.join(10.0)
            process.kill()
            imu.close()


def _measured(
    endpoints: BusSettings, service: Connection, imu: Any, seconds: float, report: Callable[[str], None]
) -> dict[str, Any]:
    taken: dict[str, list[Any]] = {"on": [], "off": []}
    spent: dict[str, list[float]] = {"on": [], "off": []}
    with _Wearer(endpoints, imu) as wearer:
        for pair in range(PAIRS):
            # In turns who is first: what drifts meanwhile favours neither.
            for state in ("on", "off") if pair % 2 == 0 else ("off", "on"):
                report(f"pair {pair + 1} of {PAIRS}, camera {state}")
                service.send(state)
                wearer.settle(service.poll, fixes=state == "on")
                service.recv()
                began = _cpu_s(service)
                taken[state].append(wearer.latencies(seconds))
                spent[state].append(_cpu_s(service) - began)
    more_s = float(np.median(np.subtract(spent["on"], spent["off"])))
    return {
        **{name: _compared(taken, column) for column, name in enumerate(("published", "received"))},
        "service_cpu_ms_per_picture": round(1e3 * more_s / (FPS * seconds), 3),
        "pairs": PAIRS,
        "samples_per_phase": min(len(run) for runs in taken.values() for run in runs),
        "fixes_per_s": round(max(wearer.fix_rates), 1),
    }


def _cpu_s(service: Connection) -> float:
    service.send("cpu")
    return float(service.recv())


def _compared(taken: dict[str, list[Any]], column: int) -> dict[str, Any]:
    """Camera on and off, ms, all phases together, and the median over the pairs of on / off."""
    runs = {state: [np.array(phase)[:, column] for phase in phases] for state, phases in taken.items()}
    pairs = list(zip(runs["on"], runs["off"], strict=True))
    return {
        **{f"{state}_ms": _quantiles(np.concatenate(phases)) for state, phases in runs.items()},
        "ratio": {
            name: round(float(np.median([np.percentile(on, q) / np.percentile(off, q) for on, off in pairs])), 3)
            for name, q in (("p50", 50), ("p99", 99))
        },
    }


class _Wearer:
    """Somebody who stands still: an IMU's bytes at its rate, head poses in between, and an ear for what comes back."""

    def __init__(self, endpoints: BusSettings, imu: Any) -> None:
        from foottrack_service.simulation.scenario import simulate

        self._imu = imu
        scenario = simulate("still", 1, seconds=60.0, imu_hz=_IMU_HZ, camera=False, right_imu=False)
        bodies: dict[str, list[Any]] = {"imu/left": [], "head/pose": []}
        for _, message in scenario.messages():
            if message.stream in bodies:
                bodies[message.stream].append(message.data)
        self._samples: list[Imu] = bodies["imu/left"]
        self._heads: list[HeadPose] = bodies["head/pose"]
        self._number = 0
        self._fixes = 0
        self.fix_rates: list[float] = []
        self._context = zmq.Context()
        self._out, self._back = self._context.socket(zmq.PUB), self._context.socket(zmq.SUB)
        for topic in (b"user/pose/body", b"user/marker/", b"sys/welcome"):
            self._back.setsockopt(zmq.SUBSCRIBE, topic)
        self._back.setsockopt(zmq.RCVTIMEO, _TIMEOUT_MS)
        self._back.connect(endpoints.egress)
        self._out.connect(endpoints.ingress)
        self._back.recv_multipart()
        self._due = time.perf_counter()

    def __enter__(self) -> _Wearer:
        return self

    def __exit__(self, *_: object) -> None:
        self._context.destroy(linger=0)

    def settle(self, switched: Callable[[], bool], fixes: bool) -> None:
        """Wear on until the camera is switched and what it brings is steady."""
        deadline = time.perf_counter() + _START_S
        while not switched():
            self._sample()
            if time.perf_counter() > deadline:
                raise CommandFailed("the camera did not start or stop")
        self._fixes = 0
        number = 0
        while number < _SETTLE or (fixes and self._fixes < _SETTLE):
            self._sample()
            number += 1
            if time.perf_counter() > deadline:
                raise CommandFailed("no feet were found in the pictures")

    def latencies(self, seconds: float) -> list[tuple[float, float]]:
        """ms to publishing and to receiving, per sample."""
        self._fixes, began = 0, time.perf_counter()
        found = [self._sample() for _ in range(int(seconds * _IMU_HZ))]
        self.fix_rates.append(self._fixes / (time.perf_counter() - began))
        return found

    def _sample(self) -> tuple[float, float]:
        self._due = max(self._due + 0.5 / _IMU_HZ, time.perf_counter() - 0.1)
        _until(self._due)
        now = time.perf_counter_ns()
        head = self._heads[self._number % len(self._heads)]
        self._out.send_multipart(
            encode(Message("user", "head/pose", "bench", "bench", self._number, now, now, True, head))
        )
        self._due += 0.5 / _IMU_HZ
        _until(self._due)
        while self._back.poll(0):
            self._count(self._back.recv_multipart()[0])
        # A device's counter goes on when the scenario begins again.
        ticks = round(self._number * 1e6 / _IMU_HZ)
        sample = self._samples[self._number % len(self._samples)].model_copy(update={"t_dev": ticks})
        self._number += 1
        began = time.perf_counter_ns()
        self._imu.send(sample)
        try:
            while not self._count((frames := self._back.recv_multipart())[0]):
                pass
        except zmq.Again:
            raise CommandFailed(f"no pose came of an IMU's sample within {1e-3 * _TIMEOUT_MS:g} s") from None
        received = time.perf_counter_ns()
        return (decode(frames).t_pub - began) * 1e-6, (received - began) * 1e-6

    def _count(self, topic: bytes) -> bool:
        if topic == b"user/pose/body":
            return True
        self._fixes += 1
        return False


def _draw(folder: Path) -> None:
    """A standing person's pictures in TUM's layout, as arrays to map: handing them over is not what is measured."""
    from foottrack_service.camera.setup import open_source

    task = {"task": "still", "seed": 1, "seconds": 60.0, "fps": FPS, "start": 0, "readout": 0.0}
    source = open_source(Settings(camera={"source": {"kind": "rendered", "rendered": task}}), None)
    lists: dict[str, list[str]] = {"rgb": [], "depth": []}
    for number in range(_PICTURES):
        frame = source.read()
        for kind, picture in (("rgb", frame.gray), ("depth", np.asarray(frame.depth))):
            name = f"{kind}-{number:04d}.npy"
            np.save(folder / name, picture)
            lists[kind].append(f"{number / FPS:.6f} {name}")
    for kind, lines in lists.items():
        (folder / f"{kind}.txt").write_text("\n".join(lines), encoding="utf-8")


def _serve(pipe: Connection, folder: str, port: str) -> None:
    collect_seldom()
    try:
        run_loop(_run_service(pipe, folder, port))
    except KeyboardInterrupt:
        return


async def _run_service(pipe: Connection, folder: str, port: str) -> None:
    from foottrack_service.app import NODES, Service

    pictures = {"path": folder, "depth_scale": 1000.0, "loop": True}
    settings = Settings(
        bus=BusSettings.beginning_at("0").model_dump(exclude={"curve"}),
        # No limit on outputs, since each sample's own is timed.
        fusion={"max_output_hz": 10_000.0},
        imu={"left": {"format": "rvc", "port": port}},
        camera={"source": {"kind": "folder", "folder": pictures}},
    )
    async with Service(settings) as service:
        service.start(NODES["fusion"])
        service.start(NODES["imu"])
        await service.running("fusion")
        await service.running("imu-left")
        pipe.send(service.endpoints.model_dump(exclude={"curve"}))
        loop = asyncio.get_running_loop()
        orders: asyncio.Queue[str] = asyncio.Queue()
        threading.Thread(target=_hear, args=(pipe, loop, orders), daemon=True).start()
        camera: asyncio.Task[None] | None = None
        while (order := await orders.get()) != "stop":
            if order == "on" and camera is None:
                camera = service.start(NODES["camera"])
                await service.running("camera")
            elif order == "off" and camera is not None:
                camera.cancel()
                await asyncio.gather(camera, return_exceptions=True)
                camera = None
            pipe.send(time.process_time() if order == "cpu" else order)


def _hear(pipe: Connection, loop: asyncio.AbstractEventLoop, orders: asyncio.Queue[str]) -> None:
    order = ""
    while order != "stop":
        try:
            order = pipe.recv()
        except EOFError:
            order = "stop"
        loop.call_soon_threadsafe(orders.put_nowait, order)


def _until(due: float) -> None:
    left = due - time.perf_counter()
    if left > 0:
        time.sleep(left)


def _quantiles(values: Any) -> dict[str, float]:
    return {"p50": round(float(np.percentile(values, 50)), 3), "p99": round(float(np.percentile(values, 99)), 3)}
