"""What the bus costs, beside bare pyzmq in the same run: ``python tests/benchmarks/bus.py [--seconds 10]``.

CPU time per call where nothing waits; the hop is paced at 200 Hz, messages for our subscriber and for a bare SUB socket
in turn, both in processes of their own behind the same proxy.
"""

from __future__ import annotations

import argparse
import asyncio
import multiprocessing
import struct
import time
from collections.abc import Callable
from multiprocessing.connection import Connection

import zmq

from foottrack_protocol import decode, encode
from foottrack_protocol.messages import Imu
from foottrack_service.bus import Broker, Publisher, Subscriber
from foottrack_service.config import BusSettings

SAMPLE = Imu(
    acc=(0.12, 9.79, -0.31),
    gyro=(0.01, -0.02, 0.03),
    q=(0.0, 0.0, 0.0, 1.0),
    t_dev=123_456_789,
    t_arr=123_456_789_012,
)
BARE = b"bare"
HALF_PERIOD_S = 0.0025


def ours(egress: str, pipe: Connection) -> None:
    """Delays (ns) of a paced stream at our subscriber."""

    async def collect() -> list[int]:
        subscriber = Subscriber(zmq.Context.instance(), egress, ["user/"])
        await subscriber.ready()
        pipe.send("ready")
        delays = []
        async for received in subscriber:
            if not received.message.valid:
                break
            delays.append(received.arrival - received.message.t_pub)
        return delays

    pipe.send(asyncio.run(collect()))


def bare(egress: str, pipe: Connection) -> None:
    """Delays (ns) of a paced stream at a SUB socket that blocks."""
    socket: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.SUB)
    socket.subscribe(BARE)
    socket.subscribe("sys/welcome")
    socket.connect(egress)
    assert socket.recv() == b"sys/welcome"
    pipe.send("ready")
    delays = []
    while (sent := struct.unpack("q", socket.recv_multipart()[1])[0]) >= 0:
        delays.append(time.perf_counter_ns() - sent)
    pipe.send(delays)


def hop(broker: Broker, context: zmq.Context[zmq.Socket[bytes]], seconds: float) -> dict[str, list[int]]:
    """Publish to both in turn, and gather their delays."""
    start = multiprocessing.get_context("spawn")
    pipes = {}
    for name, target in (("ours", ours), ("bare", bare)):
        near, far = start.Pipe()
        start.Process(target=target, args=(broker.endpoints.egress, far), daemon=True).start()
        pipes[name] = near
        assert near.recv() == "ready"
    publisher = Publisher(context, broker.endpoints.ingress, "bench")
    publisher.wait_ready()
    raw = context.socket(zmq.XPUB)
    raw.connect(broker.endpoints.ingress)
    raw.recv()
    for _ in range(int(seconds / (2 * HALF_PERIOD_S))):
        publisher.publish("user", "imu/left", 0, SAMPLE)
        time.sleep(HALF_PERIOD_S)
        raw.send_multipart([BARE, struct.pack("q", time.perf_counter_ns())])
        time.sleep(HALF_PERIOD_S)
    publisher.publish("user", "imu/left", 0, SAMPLE, valid=False)
    raw.send_multipart([BARE, struct.pack("q", -1)])
    delays: dict[str, list[int]] = {name: pipe.recv() for name, pipe in pipes.items()}
    publisher.close()
    raw.close(0)
    return delays


def cpu_us(count: int, work: Callable[[], object]) -> float:
    """CPU time of this thread per item, us."""
    start = time.thread_time_ns()
    work()
    return (time.thread_time_ns() - start) / count / 1e3


def repeat(count: int, work: Callable[[], object]) -> Callable[[], None]:
    """``work`` so many times."""

    def run() -> None:
        for _ in range(count):
            work()

    return run


def costs(broker: Broker, context: zmq.Context[zmq.Socket[bytes]]) -> None:
    """CPU time per message, best of several rounds of 2,000."""
    publisher = Publisher(context, broker.endpoints.ingress, "bench")
    subscriber = Subscriber(context, broker.endpoints.egress, ["user/"])
    publisher.wait_ready()
    subscriber.wait_ready()
    count, publish, drain = 2_000, float("inf"), float("inf")
    message = publisher.publish("user", "imu/left", 0, SAMPLE)
    taken = 0
    while not taken:
        taken = len(subscriber.drain())
    for _ in range(8):
        publish = min(publish, cpu_us(count, repeat(count, lambda: publisher.publish("user", "imu/left", 0, SAMPLE))))
        left = count
        used = 0
        while left:
            subscriber._socket.poll(1_000)
            before = time.thread_time_ns()
            left -= len(subscriber.drain())
            used += time.thread_time_ns() - before
        drain = min(drain, used / count / 1e3)
    frames = encode(message)
    encoding = cpu_us(count, repeat(count, lambda: encode(message)))
    decoding = cpu_us(count, repeat(count, lambda: decode(frames)))
    print(f"publish        {publish:6.1f} us CPU, of it encode {encoding:.1f}")
    print(f"drain          {drain:6.1f} us CPU, of it decode {decoding:.1f}")
    publisher.close()
    subscriber.close()


def sustained(broker: Broker, context: zmq.Context[zmq.Socket[bytes]], seconds: float) -> None:
    """Messages/s from one publisher to one subscriber in the same loop, never more than 1,000 under way."""
    publisher = Publisher(context, broker.endpoints.ingress, "bench")
    subscriber = Subscriber(context, broker.endpoints.egress, ["user/"])

    async def run() -> None:
        await publisher.ready()
        await subscriber.ready()
        received = 0
        start = time.perf_counter()
        publisher.publish("user", "imu/left", 0, SAMPLE)
        async for batch in subscriber.batches():
            received += len(batch)
            while publisher.sent - received < 1_000:
                publisher.publish("user", "imu/left", 0, SAMPLE)
            if time.perf_counter() - start > seconds:
                break
        elapsed = time.perf_counter() - start
        gaps = subscriber.stats.topics["user/imu/left"].gaps
        print(f"sustained      {received / elapsed:6.0f} messages/s, both ends in one thread; {gaps} gaps")

    asyncio.run(run())
    publisher.close()
    subscriber.close()


def main() -> None:
    """Print all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with Broker(BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0")) as broker:
        costs(broker, context)
        sustained(broker, context, min(seconds, 3.0))
        medians = {}
        for name, delays in hop(broker, context, seconds).items():
            delays.sort()
            medians[name] = delays[len(delays) // 2]
            p99 = delays[int(0.99 * len(delays))]
            print(f"hop, {name}      {medians[name] / 1e3:6.0f} us p50, {p99 / 1e3:.0f} us p99, {len(delays)} messages")
        print(f"ours / bare    {medians['ours'] / medians['bare']:6.2f} at p50")
        context.term()


if __name__ == "__main__":
    main()
