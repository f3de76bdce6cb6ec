"""How fast the Unity package is under mono, beside a pyzmq subscriber in the same run.

Run: python tests/clients/bench_unity.py [--seconds 10] [--hz 200 1000]
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

from bench_godot import BURST, Peer, publish_at, quantiles, received
from client_traffic import FINAL, POSE
from live_service import LiveService
from unity_mono import MISSING, NURSERY_BYTES, UnityPackage, has_mono

from foottrack_client import Client


def measured(unity: UnityPackage, hz: float, seconds: float) -> dict[str, Any]:
    """Latency and memory at a rate."""
    with LiveService() as service, Client(service.endpoints) as client:
        subscription = client.subscribe("gait/", "pose/")
        publisher = client.publisher("bench")
        publisher.wait_ready()
        subscription.wait_ready()
        with unity.bench(service.endpoints, "quiet") as run:
            peer = Peer(subscription, client)
            peer.start()
            run.until("connected")
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
        "unity_thread_ms": quantiles(said["in_thread_ms"]),
        "unity_main_thread_ms": quantiles(said["in_main_ms"]),
        "longest_frame_ms": round(said["longest_frame_ms"], 1),
        "collections": said["collections"],
        "garbage_bytes_per_message_below": round((said["collections"] + 1) * NURSERY_BYTES / (hz * seconds), 1),
        "pyzmq_ms": quantiles(peer.late_ms),
    }


def throughput(unity: UnityPackage) -> dict[str, Any]:
    """Body poses per second when they come as fast as they can."""
    with LiveService() as service, Client(service.endpoints) as client:
        publisher = client.publisher("bench")
        publisher.wait_ready()
        with unity.bench(service.endpoints, "talk") as run:
            run.until("connected")
            begin = time.perf_counter()
            for number in range(BURST):
                publisher.publish("pose/body", POSE)
                # Below the high-water mark of 10,000: what is measured is the client, not the loss.
                if number % 4000 == 3999:
                    while received(run.until("frames")) < number - 2000:
                        pass
            publisher.publish("gait/event", FINAL)
            said = run.until("final")
            took = time.perf_counter() - begin
    return {"messages_per_s": round(BURST / took), "gaps": said["statistics"]["topics"]["user/pose/body"]["gaps"]}


def main() -> None:
    """Print one line of JSON for each measurement."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--hz", type=float, nargs="*", default=[200.0, 1000.0])
    asked = parser.parse_args()
    if not has_mono():
        raise SystemExit(MISSING)
    with tempfile.TemporaryDirectory() as folder:
        unity = UnityPackage(Path(folder) / "bench.exe")
        for hz in asked.hz:
            print(json.dumps(measured(unity, hz, asked.seconds)), flush=True)
        if asked.hz:
            print(json.dumps(throughput(unity)), flush=True)


if __name__ == "__main__":
    main()
