"""Hostile bytes for each client: it lives on, takes and refuses what our own decoder does, and keeps its memory.

The first half sends damaged messages on a connection that stands, the second one damaged connections, three at once.

Run: python tests/clients/fuzz.py [--minutes 3] [--only python godot unity] [--seed 1]
"""

from __future__ import annotations

import argparse
import json
import random
import socket
import sys
import tempfile
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from client_traffic import FINAL, frames, ports
from fake_service import COMMAND, FakeService, Peer, frame, greeting, message, ready
from godot_project import GodotProject, GodotRun, find_godot
from unity_mono import MISSING, UnityPackage, has_mono

from foottrack_client import Endpoints
from foottrack_protocol import DecodeError, decode

CLIENTS = ("python", "godot", "unity")
STREAMS = ("pose/body", "pose/ik", "gait/state", "gait/event")
BATCH = 300
_VECTORS = Path(__file__).parents[2] / "protocol/vectors"


class Damage:
    """Golden messages of the streams that all clients subscribe to, and what chance makes of bytes."""

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)
        vectors = [
            vector
            for path in sorted(_VECTORS.glob("*.json"))
            if path.name != "invalid.json"
            for vector in json.loads(path.read_text(encoding="utf-8"))["vectors"]
        ]
        # The test's client in Godot takes this one for an order to stand still.
        self._good = [
            (f"user/{stream}".encode(), bytes.fromhex(vector["payload_hex"]) + bytes(vector.get("payload_zeros", 0)))
            for vector in vectors
            if (stream := vector["topic"].partition("/")[2]) in STREAMS
            and vector["message"]["data"].get("event") != "first_step"
        ]

    def message(self) -> tuple[bytes, ...]:
        """Two frames, most often, of which something is wrong, most often."""
        topic, payload = self._chance.choice(self._good)
        what = self._chance.random()
        if what < 0.02:
            return (topic, self.bytes(payload), b"x")
        if what < 0.05:
            return (topic[:10] + self._chance.randbytes(self._chance.randrange(40)), payload)
        if what < 0.06:
            return (topic, self._chance.randbytes(self._chance.randrange(300_000)))
        return (topic, self.bytes(payload) if what < 0.95 else payload)

    def bytes(self, good: bytes) -> bytes:
        """Some flipped, cut out, put in, doubled."""
        damaged = bytearray(good)
        for _ in range(self._chance.randrange(1, 4)):
            at = self._chance.randrange(len(damaged)) if damaged else 0
            match self._chance.randrange(4):
                case 0 if damaged:
                    damaged[at] = self._chance.choice([self._chance.randrange(256), 0xC1, 0xDF, 0xDD, 0xC6, 0xFF, 0])
                case 1:
                    del damaged[at : at + self._chance.randrange(1, 9)]
                case 2:
                    damaged[at:at] = self._chance.randbytes(self._chance.randrange(1, 9))
                case _:
                    damaged[at:at] = damaged[at : at + self._chance.randrange(1, 30)]
        return bytes(damaged)

    def connection(self, socket_type: bytes) -> bytes:
        """All that a server says in a connection."""
        whole = greeting() + ready(socket_type) + message(b"sys/welcome") + message(*self.message())
        whole += frame(b"\x04PING\x00\x0acontext", COMMAND) + message(b"\x01") + message(b"", b"\x80")
        # Often only behind the greeting, so that the handshake is passed.
        head = self._chance.choice([0, 64, len(greeting() + ready(socket_type))])
        return whole[:head] + self.bytes(whole[head:])


def started(stack: ExitStack, name: str, endpoints: Endpoints) -> GodotRun | None:
    """A client that tells its counters; None where its engine is missing."""
    if name == "python":
        program = [sys.executable, str(Path(__file__).with_name("python_game.py")), json.dumps(endpoints), "other"]
        return stack.enter_context(GodotRun(program))
    if name == "godot":
        found = find_godot()
        if found is None:
            print("godot: left out, no Godot 4 (tests/clients/install_godot.sh)", file=sys.stderr)
            return None
        project = stack.enter_context(GodotProject(found))
        settings = {**ports(endpoints), "streams": ["pose/", "gait/"]}
        return stack.enter_context(project.start("client.gd", settings))
    if not has_mono():
        print(f"unity: left out, {MISSING}", file=sys.stderr)
        return None
    folder = stack.enter_context(tempfile.TemporaryDirectory())
    return stack.enter_context(UnityPackage(Path(folder) / "fuzz.exe").play(endpoints))


def counted(said: dict[str, Any]) -> tuple[int, int]:
    """Messages taken and refused, in a line of any client."""
    statistics = said["statistics"]
    lost = statistics.get("unread", {}).get("refused", statistics.get("drops", {}))
    taken, refused = 0, sum(lost.values())
    for name, topic in statistics["topics"].items():
        if not name.startswith("sys/"):
            taken += topic["messages"]
            refused += sum(topic.get("refused", topic.get("drops", {})).values())
    return taken, refused


def damaged_messages(run: GodotRun, peer: Peer, damage: Damage, seconds: float) -> dict[str, int]:
    """As many as it takes. Raises AssertionError where the client judges otherwise than our decoder."""
    taken = refused = 0
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        batch = [damage.message() for _ in range(BATCH)]
        for each in batch:
            try:
                decode(each)
                taken += 1
            except DecodeError:
                refused += 1
        peer.send(b"".join(message(*each) for each in batch))
        while sum(found := counted(run.until("frames"))) < taken + refused:
            pass
        if found != (taken, refused):
            raise AssertionError(f"taken and refused are {found}, not {(taken, refused)}, within {batch!r}")
    return {"taken": taken, "refused": refused}


def damaged_connections(fake: FakeService, damage: Damage, seconds: float) -> int:
    """As many as the client makes on all of its sockets. Says how many."""
    until = time.monotonic() + seconds
    made: list[int] = []

    def break_one_after_another(accept: Any, socket_type: bytes) -> None:
        while time.monotonic() < until:
            with suppress(socket.timeout, ConnectionError):
                peer = accept()
                made.append(1)
                peer.send(damage.connection(socket_type))
                peer.read(10)
                peer.close()

    sockets = [(fake.egress, b"XPUB"), (fake.ingress, b"XSUB"), (fake.control, b"ROUTER")]
    threads = [threading.Thread(target=break_one_after_another, args=each) for each in sockets]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return len(made)


def fuzzed(name: str, minutes: float, seed: int) -> dict[str, Any] | None:
    """One client's run."""
    damage = Damage(seed)
    with ExitStack() as stack:
        fake = stack.enter_context(FakeService())
        run = started(stack, name, fake.endpoints)
        if run is None:
            return None
        peer = fake.live_egress()
        run.until("frames")
        memory_kb = [run.memory_kb()]
        messages = damaged_messages(run, peer, damage, minutes * 30.0)
        memory_kb.append(run.memory_kb())
        peer.close()
        connections = damaged_connections(fake, damage, minutes * 30.0)
        memory_kb.append(run.memory_kb())
        # It is as good as new: what is sent now arrives.
        while True:
            peer = fake.egress()
            with suppress(AssertionError, IndexError, ConnectionError, socket.timeout):
                peer.welcome()
                break
        peer.send(message(*frames("gait/event", FINAL)))
        run.until("final")
    return {
        "client": name,
        "messages": messages,
        "connections": connections,
        "memory_mb": [kb // 1024 for kb in memory_kb],
    }


def main() -> None:
    """Print one line of JSON for each client."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=3.0, help="for each client")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=list(CLIENTS), choices=CLIENTS)
    asked = parser.parse_args()
    for name in asked.only:
        result = fuzzed(name, asked.minutes, asked.seed)
        if result is not None:
            print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
