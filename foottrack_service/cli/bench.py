"""``foottrack bench``: latency and throughput, each beside its bare-library floor in the same run."""

from __future__ import annotations

import multiprocessing
import threading
import time
from multiprocessing.connection import Connection
from typing import Annotated, Any

import numpy as np
import typer
import zmq
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from foottrack_protocol import Message, encode
from foottrack_protocol.frames import STANDARD_GRAVITY
from foottrack_protocol.messages import HeadPose, Imu
from foottrack_service.cli.running import CommandFailed, JsonOption, collect_seldom, print_json, run_loop
from foottrack_service.config import BusSettings, Settings

_PACE_S = 1 / 200
_FLOOR_TOPIC = b"bench/floor"
_TIMEOUT_MS = 2000
_STARTS_WITHIN_S = 120.0
"""The first start on a machine compiles the filter."""
_LADDER = (2_000, 5_000, 10_000, 20_000, 40_000, 80_000)
_STEP_S = 1.0


def bench(
    seconds: Annotated[float, typer.Option("--seconds", min=1.0, help="How long each latency is measured.")] = 10.0,
    faults: Annotated[
        bool, typer.Option("--faults", help="Instead: what is lost when parts fail (half a minute).")
    ] = False,
    camera: Annotated[
        bool, typer.Option("--camera", help="Instead: IMU bytes to pose with the camera on and off, in pairs.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Measure the service: IMU sample to pose, messages per second, idle CPU, the filter. About 40 s.

    Latencies are taken in turns with a bare pyzmq hop through the same proxy, so that a busy machine slows both.
    Example: foottrack bench --seconds 20
    """
    if faults:
        from foottrack_service.cli.bench_faults import fault_runs

        with Console(stderr=True).status("breaking things ..."):
            print_json({"faults": run_loop(fault_runs())})
        return
    if camera:
        from foottrack_service.cli.bench_camera import camera_pairs

        with Console(stderr=True).status("drawing pictures") as status:
            print_json({"camera": camera_pairs(seconds, status.update)})
        return
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs,), daemon=True)
    process.start()
    try:
        if not ours.poll(_STARTS_WITHIN_S):
            raise CommandFailed(f"the service did not start within {_STARTS_WITHIN_S:g} s")
        endpoints = BusSettings(**ours.recv())
        with Progress(console=Console(stderr=True), transient=True, disable=as_json) as progress:
            task = progress.add_task("idle CPU", total=3)
            idle = _idle_cpu(ours)
            progress.update(task, advance=1, description="latency")
            latency = _latency(endpoints, seconds)
            progress.update(task, advance=1, description="throughput")
            throughput = _throughput(endpoints)
            progress.update(task, advance=1)
    finally:
        ours.send("stop")
        process.join(5.0)
        process.kill()
    from foottrack_service.cli.bench_filter import filter_costs

    results = {
        "latency_us": latency,
        "bus_messages_per_s": throughput,
        "idle_cpu_percent": round(100 * idle, 2),
        "filter": filter_costs(),
    }
    if as_json:
        print_json(results)
    else:
        _show(results)


def _serve(pipe: Connection) -> None:
    collect_seldom()
    try:
        run_loop(_run_service(pipe))
    except KeyboardInterrupt:
        return


async def _run_service(pipe: Connection) -> None:
    import asyncio

    from foottrack_service.app import NODES, Service

    # Ports of its own, so that it runs beside a service; no limit on outputs, since each sample's own is timed.
    settings = Settings(bus=BusSettings.beginning_at("0").model_dump(), fusion={"max_output_hz": 10_000.0})
    async with Service(settings) as service:
        service.start(NODES["fusion"])
        await service.running("fusion")
        pipe.send(service.endpoints.model_dump())
        loop = asyncio.get_running_loop()
        stop = loop.create_future()

        def answer() -> None:
            while (asked := pipe.recv()) != "stop":
                assert asked == "cpu"
                pipe.send(time.process_time())
            loop.call_soon_threadsafe(stop.set_result, None)

        threading.Thread(target=answer, daemon=True).start()
        await stop


def _idle_cpu(pipe: Connection) -> float:
    def spent() -> float:
        pipe.send("cpu")
        return float(pipe.recv())

    before, began = spent(), time.perf_counter()
    threading.Event().wait(3.0)
    return (spent() - before) / (time.perf_counter() - began)


def _latency(endpoints: BusSettings, seconds: float) -> dict[str, Any]:
    """IMU sample to ``pose/body``, and a bare hop, in turns at 200 Hz; microseconds."""
    with zmq.Context() as context, context.socket(zmq.PUB) as out, context.socket(zmq.SUB) as back:
        for topic in (_FLOOR_TOPIC, b"user/pose/body", b"sys/welcome"):
            back.setsockopt(zmq.SUBSCRIBE, topic)
        back.setsockopt(zmq.RCVTIMEO, _TIMEOUT_MS)
        back.connect(endpoints.egress)
        out.connect(endpoints.ingress)
        back.recv_multipart()
        _warm_up(out, back)
        bare, through = [], []
        rounds = int(seconds / _PACE_S)
        due = time.perf_counter()
        payload = _imu_frames(0)[1]
        for number in range(rounds):
            due += _PACE_S / 2
            _until(due)
            began = time.perf_counter_ns()
            out.send_multipart([_FLOOR_TOPIC, payload])
            _await(back, _FLOOR_TOPIC)
            bare.append(time.perf_counter_ns() - began)
            due += _PACE_S / 2
            _until(due)
            _discard(back)
            frames = _imu_frames(number)
            began = time.perf_counter_ns()
            out.send_multipart(frames)
            _await(back, b"user/pose/body")
            through.append(time.perf_counter_ns() - began)
    floor, ours = _quantiles(bare), _quantiles(through)
    return {
        "imu_to_pose": ours,
        "bare_hop": floor,
        "ratio": {name: round(ours[name] / floor[name], 2) for name in ours},
        "samples": rounds,
    }


def _throughput(endpoints: BusSettings) -> int:
    """The highest rate of the ladder at which every message of a second arrived. It is sent by a thread."""
    best = 0
    topic, payload = b"bench/flood", _imu_frames(0)[1]
    for rate in _LADDER:
        with zmq.Context() as context, context.socket(zmq.PUB) as out, context.socket(zmq.SUB) as back:
            out.setsockopt(zmq.SNDHWM, 10_000)
            back.setsockopt(zmq.RCVHWM, 10_000)
            back.setsockopt(zmq.RCVTIMEO, _TIMEOUT_MS)
            back.setsockopt(zmq.SUBSCRIBE, topic)
            back.setsockopt(zmq.SUBSCRIBE, b"sys/welcome")
            back.connect(endpoints.egress)
            out.connect(endpoints.ingress)
            back.recv_multipart()
            _reach(out, back, topic)
            total = int(rate * _STEP_S)
            sender = threading.Thread(target=_send_paced, args=(out, topic, payload, total, rate))
            began = time.perf_counter()
            sender.start()
            arrived = 0
            try:
                while arrived < total:
                    back.recv_multipart()
                    arrived += 1
            except zmq.Again:
                pass
            took = time.perf_counter() - began
            sender.join()
        if arrived < total or took > 1.2 * _STEP_S:
            break
        best = rate
    return best


def _send_paced(out: zmq.Socket[bytes], topic: bytes, payload: bytes, total: int, rate: int) -> None:
    began = time.perf_counter()
    for number in range(total):
        if number % 20 == 0:
            _until(began + number / rate)
        out.send_multipart([topic, payload])


def _warm_up(out: zmq.Socket[bytes], back: zmq.Socket[bytes]) -> None:
    _reach(out, back, _FLOOR_TOPIC)
    body = HeadPose(p=(0.0, 1.6, 0.0), q=(0.0, 0.0, 0.0, 1.0), tracked=True)
    for number in range(100):
        now = time.perf_counter_ns()
        out.send_multipart(encode(Message("user", "head/pose", "bench", "bench", number, now, now, True, body)))
        out.send_multipart(_imu_frames(number))
        _await(back, b"user/pose/body")


def _reach(out: zmq.Socket[bytes], back: zmq.Socket[bytes], topic: bytes) -> None:
    """Send until something comes back: a bare PUB cannot know when the bus has heard of it."""
    for _ in range(200):
        out.send_multipart([topic, b""])
        if back.poll(20):
            _discard(back)
            break
    else:
        raise CommandFailed("nothing comes back through the bus")
    while back.poll(50):
        _discard(back)


def _imu_frames(number: int) -> tuple[bytes, bytes]:
    now = time.perf_counter_ns()
    wobble = 0.5 * float(np.sin(number * 0.1))
    body = Imu(acc=(wobble, STANDARD_GRAVITY, 0.3), gyro=(0.0, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0), t_arr=now)
    return encode(Message("user", "imu/left", "bench", "bench", number, now, now, True, body))


def _await(back: zmq.Socket[bytes], topic: bytes) -> None:
    while back.recv_multipart()[0] != topic:
        pass


def _discard(back: zmq.Socket[bytes]) -> None:
    while back.poll(0):
        back.recv_multipart()


def _until(due: float) -> None:
    left = due - time.perf_counter()
    if left > 0:
        time.sleep(left)


def _quantiles(ns: list[int]) -> dict[str, float]:
    p50, p99 = np.percentile(np.array(ns) * 1e-3, [50, 99])
    return {"p50": round(float(p50), 1), "p99": round(float(p99), 1)}


def _show(results: dict[str, Any]) -> None:
    latency = results["latency_us"]
    table = Table(title=f"Latency, us, {latency['samples']} samples at 200 Hz, in turns", title_justify="left")
    table.add_column("")
    table.add_column("p50", justify="right")
    table.add_column("p99", justify="right")
    for name, label in (("imu_to_pose", "IMU sample -> pose/body"), ("bare_hop", "bare pyzmq hop"), ("ratio", "ratio")):
        table.add_row(label, str(latency[name]["p50"]), str(latency[name]["p99"]))
    console = Console()
    console.print(table)
    console.print(f"The bus carries at least {results['bus_messages_per_s']} messages/s without a loss.")
    console.print(f"The idle service takes {results['idle_cpu_percent']} % of a core.")
    from foottrack_service.cli.bench_filter import lines

    for line in lines(results["filter"]):
        console.print(line, highlight=False)
