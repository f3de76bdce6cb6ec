"""Somebody on the service's host: hears the heads that an engine publishes, then sends it gait events.

Run as a program: ``network_party.py SOURCE HEADS EVENTS``. It talks in lines of JSON: "ready", "heads" when so many
valid head poses of the source came. It waits for a line before it sends the events and the last one, and for another
to end.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from client_traffic import FINAL, POSE, step
from godot_project import LINE

from foottrack_client import Client


def say(kind: str, **values: Any) -> None:
    print(LINE + json.dumps({"kind": kind, **values}), flush=True)


def main(source: str, heads: int, events: int) -> None:
    with Client() as client, client.subscribe("head/pose") as subscription:
        publisher = client.publisher("party")
        publisher.wait_ready()
        subscription.wait_ready()
        say("ready")
        seqs: list[int] = []
        delays_ns: list[int] = []
        while len(seqs) < heads:
            message = subscription.receive(40.0)
            assert message is not None, f"no head pose of {source}"
            if message.src == source and message.valid:
                seqs.append(message.seq)
                delays_ns.append(client.clock() - message.t_pub)
                assert message.t <= message.t_pub
        say("heads", seqs=seqs, delays_ns=delays_ns)
        sys.stdin.readline()
        for number in range(events):
            publisher.publish("gait/event", step(number))
            publisher.publish("pose/body", POSE)
        publisher.publish("gait/event", FINAL)
        sys.stdin.readline()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
