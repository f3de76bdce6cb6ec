"""The Python client, or pyzmq and msgpack alone, in a long run: says what came, how late, in lines of JSON.

Run as a program: ``long_receiver.py python|pyzmq ENDPOINTS``, the endpoints as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from array import array
from collections.abc import Callable, Iterator
from typing import Any

import msgpack
import zmq
from client_traffic import FINAL_STEP
from godot_project import LINE
from python_game import as_json

from foottrack_client import Client, Endpoints

SAMPLES = 500_000
PREFIXES = ("gait/", "pose/")
Counters = list[Callable[[], dict[str, Any]]]


def say(kind: str, **values: Any) -> None:
    print(LINE + json.dumps({"kind": kind, **values}), flush=True)


def with_client(endpoints: Endpoints, counters: Counters) -> Iterator[tuple[int, str | None, int]]:
    """t_pub, the gait event if it is one, and its step, of each message; and its counters."""
    with Client(endpoints) as client, client.subscribe(*PREFIXES) as subscription:
        counters.append(lambda: as_json(subscription.statistics))
        found = 0
        while True:
            message = subscription.receive(0.1)
            if subscription.statistics.connections > found:
                found = subscription.statistics.connections
                say("connected")
            if message is not None:
                is_event = message.stream == "gait/event"
                yield message.t_pub, message.data.event if is_event else None, message.data.step if is_event else 0


def bare(endpoints: Endpoints, counters: Counters) -> Iterator[tuple[int, str | None, int]]:
    """The same without a client: the floor."""
    socket = zmq.Context().socket(zmq.SUB)
    socket.set_hwm(10_000)
    for prefix in PREFIXES:
        socket.subscribe(f"user/{prefix}")
    socket.subscribe("sys/welcome")
    socket.connect(endpoints.egress)
    topics: dict[str, dict[str, int]] = {}
    counters.append(lambda: {"topics": topics})
    last: dict[str, int] = {}
    while True:
        frames = socket.recv_multipart()
        if len(frames) == 1:
            # The bus is there once more, and reads the subscription to a token after all others.
            if frames[0] == b"sys/welcome":
                socket.subscribe(token := b"sys/welcome/" + b"%032x" % time.perf_counter_ns())
            elif frames[0] == token:
                say("connected")
            continue
        message = msgpack.unpackb(frames[1])
        topic = frames[0].decode()
        counted = topics.setdefault(topic, {"messages": 0, "gaps": 0})
        counted["messages"] += 1
        counted["gaps"] += message["seq"] - last.get(topic, message["seq"] - 1) - 1
        last[topic] = message["seq"]
        data = message["data"]
        yield message["t_pub"], data.get("event"), data.get("step", 0)


def main(kind: str, endpoints: Endpoints) -> None:
    # Taken now, so that memory that grows is the client's.
    late_ms = array("d", bytes(8 * SAMPLES))
    measured = events = 0
    counters: Counters = []
    for t_pub, event, step in (with_client if kind == "python" else bare)(endpoints, counters):
        if measured < SAMPLES:
            late_ms[measured] = (time.perf_counter_ns() - t_pub) * 1e-6
            measured += 1
        if event == "first_step":
            say("reached", step=step)
        elif event == "stop" and step == FINAL_STEP:
            break
        elif event is not None:
            events += 1
    say("final", events=events, in_main_ms=list(late_ms[:measured]), statistics=counters[0]())


if __name__ == "__main__":
    main(sys.argv[1], Endpoints(*json.loads(sys.argv[2])))
