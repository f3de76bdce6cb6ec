"""How fast the Godot addon is, beside a pyzmq subscriber in the same run.

Run: python tests/clients/bench_godot.py [--seconds 10] [--hz 200 1000]
"""

from __future__ import annotations

import argparse
import json
import statistics
import threading
import time
from typing import Any

from client_traffic import FINAL, POSE, ports, step
from godot_project import GodotProject, GodotRun, find_godot
from live_service import LiveService

from foottrack_client import Client, Subscription

BURST = 20_000


class Peer(threading.Thread):
    """A pyzmq subscriber that reads along, ms from t_pub to having the message decoded."""

    def __init__(self, subscription: Subscription, client: Client) -> None:
        super().__init__(daemon=True)
        self.late_ms: list[float] = []
        self._subscription, self._client = subscription, client

    def run(self) -> None:
        for message in self._subscription:
            if message.data == FINAL:
                return
            self.late_ms.append((self._client.clock() - message.t_pub) * 1e-6)


def quantiles(values: list[float]) -> dict[str, float]:
    """p50 and p95."""
    cuts = statistics.quantiles(values, n=100)
    return {"p50": round(cuts[49], 2), "p95": round(cuts[94], 2)}


def publish_at(publisher: Any, hz: float, seconds: float, first: int = 0) -> int:
    """One pose and one event alternately, each at its own deadline. Says how many events."""
    begin = time.perf_counter()
    events = first
    for number in range(int(hz * seconds)):
        wait = begin + number / hz - time.perf_counter()
        if wait > 0:
            time.sleep(wait)
        if number % 2:
            publisher.publish("gait/event", step(events))
            events += 1
        else:
            publisher.publish("pose/body", POSE)
    return events


def measured(godot: GodotProject, hz: float, seconds: float) -> dict[str, Any]:
    """Latency at a rate."""
    with LiveService() as service, Client(service.endpoints) as client:
        subscription = client.subscribe("gait/", "pose/")
        publisher = client.publisher("bench")
        publisher.wait_ready()
        subscription.wait_ready()
        with bench(godot, service) as run:
            peer = Peer(subscription, client)
            peer.start()
            run.until("connected")
            run.until("frames", synchronised=True)
            events = publish_at(publisher, hz, seconds)
            publisher.publish("gait/event", FINAL)
            said = run.until("final")
            peer.join()
    topics = said["statistics"]["topics"]
    return {
        "hz": hz,
        "lost_events": events - said["events"],
        "gaps": sum(topic["gaps"] for topic in topics.values()),
        "uncertainty_ms": said["statistics"]["uncertainty_ns"] * 1e-6,
        "godot_thread_ms": quantiles(said["in_thread_ms"]),
        "godot_main_thread_ms": quantiles(said["in_main_ms"]),
        "longest_frame_ms": round(said["longest_frame_ms"], 1),
        "pyzmq_ms": quantiles(peer.late_ms),
    }


def throughput(godot: GodotProject) -> dict[str, Any]:
    """Body poses per second when they come as fast as they can."""
    with LiveService() as service, Client(service.endpoints) as client:
        publisher = client.publisher("bench")
        publisher.wait_ready()
        with bench(godot, service) as run:
            run.until("connected")
            begin = time.perf_counter()
            for number in range(BURST):
                publisher.publish("pose/body", POSE)
                # Below the high-water mark of 10,000: what is measured is the engine, not the loss.
                if number % 4000 == 3999:
                    while received(run.until("frames")) < number - 2000:
                        pass
            publisher.publish("gait/event", FINAL)
            said = run.until("final")
            took = time.perf_counter() - begin
    return {"messages_per_s": round(BURST / took), "gaps": said["statistics"]["topics"]["user/pose/body"]["gaps"]}


def received(line: dict[str, Any]) -> int:
    """Poses so far, in a line of statistics."""
    topic = line["statistics"]["topics"].get("user/pose/body", {"messages": 0})
    return int(topic["messages"])


def bench(godot: GodotProject, service: LiveService) -> GodotRun:
    """The engine's side."""
    return GodotRun(godot.command("-s", "res://bench/receiver.gd", "--", json.dumps(ports(service.endpoints))))


def main() -> None:
    """Print one line of JSON for each measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--hz", type=float, nargs="*", default=[200.0, 1000.0])
    asked = parser.parse_args()
    found = find_godot()
    if found is None:
        raise SystemExit("no Godot 4: run tests/clients/install_godot.sh, or set FOOTTRACK_GODOT to an executable")
    with GodotProject(found) as godot:
        for hz in asked.hz:
            print(json.dumps(measured(godot, hz, asked.seconds)), flush=True)
        if asked.hz:
            print(json.dumps(throughput(godot)), flush=True)


if __name__ == "__main__":
    main()
