"""Every client at once beside a bare pyzmq subscriber, 200 messages a second for long, two restarts of the service.

What is lost beyond what was sent while it was down, what memory does, and how late messages are on the main thread. A
client whose engine is not installed is left out, and said.

Run: python tests/clients/long_run.py [--minutes 10] [--hz 200] [--only python godot]
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from bench_godot import publish_at, quantiles
from client_traffic import FINAL, ports, step
from godot_project import GodotProject, GodotRun, find_godot
from live_service import LiveService
from unity_mono import MISSING, NURSERY_BYTES, UnityPackage, has_mono

from foottrack_client import Client, Endpoints
from foottrack_protocol.messages import GaitEvent

CLIENTS = ("pyzmq", "python", "godot", "unity")
PARTS = 3
SLICES = 4
"""Of each part: so often memory is looked at."""
SENT_WHILE_DOWN = 50


def started(stack: ExitStack, name: str, endpoints: Endpoints) -> GodotRun | None:
    """A client that measures; None where its engine is missing."""
    if name in ("pyzmq", "python"):
        program = str(Path(__file__).with_name("long_receiver.py"))
        return stack.enter_context(GodotRun([sys.executable, program, name, json.dumps(endpoints)]))
    if name == "godot":
        found = find_godot()
        if found is None:
            print("godot: left out, no Godot 4 (tests/clients/install_godot.sh)", file=sys.stderr)
            return None
        project = stack.enter_context(GodotProject(found))
        script = ("-s", "res://bench/receiver.gd", "--", json.dumps(ports(endpoints)))
        return stack.enter_context(GodotRun(project.command(*script)))
    if not has_mono():
        print(f"unity: left out, {MISSING}", file=sys.stderr)
        return None
    folder = stack.enter_context(tempfile.TemporaryDirectory())
    return stack.enter_context(UnityPackage(Path(folder) / "bench.exe").bench(endpoints, "quiet"))


def measured(minutes: float, hz: float, names: list[str]) -> dict[str, Any]:
    """The run."""
    with ExitStack() as stack:
        service = stack.enter_context(LiveService())
        client = stack.enter_context(Client(service.endpoints))
        publisher = client.publisher("bench")
        runs = {name: run for name in names if (run := started(stack, name, service.endpoints)) is not None}
        memory_kb: dict[str, list[int]] = {name: [] for name in runs}
        events = unsent = 0
        for part in range(PARTS):
            publisher.wait_ready(20.0)
            for run in runs.values():
                run.until("connected")
            for _ in range(SLICES):
                events = publish_at(publisher, hz, minutes * 60.0 / PARTS / SLICES, events)
                for name, run in runs.items():
                    memory_kb[name].append(run.memory_kb())
            if part == PARTS - 1:
                break
            # Nothing under way is to be lost with the service: all that was sent is there when this is.
            publisher.publish("gait/event", GaitEvent(event="first_step", step=part))
            for run in runs.values():
                run.until("reached", step=part)
            service.stop()
            while publisher.live:
                pass
            for _ in range(SENT_WHILE_DOWN):
                publisher.publish("gait/event", step(events))
                events += 1
                unsent += 1
            service.start()
        publisher.publish("gait/event", FINAL)
        said = {name: run.until("final") for name, run in runs.items()}
    return {
        "minutes": minutes,
        "hz": hz,
        "events": events,
        "sent_while_down": unsent,
        "clients": {name: report(said[name], memory_kb[name], events - unsent) for name in runs},
    }


def report(said: dict[str, Any], memory_kb: list[int], due: int) -> dict[str, Any]:
    """One client's figures."""
    topics = said["statistics"]["topics"]
    made = {
        "lost_events": due - said["events"],
        "gaps": {name: topics[f"user/{name}"]["gaps"] for name in ("gait/event", "pose/body")},
        "memory_mb": [round(kb / 1024, 1) for kb in memory_kb],
        "main_thread_ms": quantiles(said["in_main_ms"]),
    }
    if "in_thread_ms" in said:
        made["receiving_thread_ms"] = quantiles(said["in_thread_ms"])
    if "collections" in said:
        messages = sum(topic["messages"] for topic in topics.values())
        made["collections"] = said["collections"]
        made["garbage_bytes_per_message_below"] = round((said["collections"] + 1) * NURSERY_BYTES / messages, 2)
    return made


def main() -> None:
    """Print one object of JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--hz", type=float, default=200.0)
    parser.add_argument("--only", nargs="*", default=list(CLIENTS), choices=CLIENTS)
    asked = parser.parse_args()
    print(json.dumps(measured(asked.minutes, asked.hz, asked.only)))


if __name__ == "__main__":
    main()
