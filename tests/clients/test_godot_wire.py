"""The addon without a service: golden vectors, every script, the clock, with a real Godot 4."""

from __future__ import annotations

import json
import random
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from godot_project import TIMEOUT_S, GodotProject

from foottrack_service.bus.timesync import Exchange, SyncedClock

pytestmark = pytest.mark.engine
VECTORS = Path(__file__).parents[2] / "protocol/vectors"


def test_every_golden_vector_is_understood_or_refused_for_its_reason(godot: GodotProject) -> None:
    counts = {
        path.name: len(json.loads(path.read_text(encoding="utf-8"))["vectors"]) for path in VECTORS.glob("*.json")
    }
    invalid = counts.pop("invalid.json")
    result = godot.run("vectors.gd", "res://vectors")
    assert result["differences"] == []
    assert (result["valid"], result["invalid"]) == (sum(counts.values()), invalid)


def test_a_vector_that_is_wrong_is_noticed(godot: GodotProject) -> None:
    def tampered(path: Path, change: Any) -> None:
        content = json.loads(path.read_text(encoding="utf-8"))
        content["vectors"] = content["vectors"][:1]
        change(content["vectors"][0])
        (folder / path.name).write_text(json.dumps(content), encoding="utf-8")

    folder = godot.folder / "tampered"
    folder.mkdir()
    tampered(VECTORS / "truth.json", lambda vector: vector["message"]["data"]["p"].__setitem__(1, 7.0))
    tampered(VECTORS / "log_record.json", lambda vector: vector["message"].update(src="somebody else"))
    tampered(VECTORS / "invalid.json", lambda vector: vector.update(reason="body"))
    differences = godot.run("vectors.gd", "res://tampered")["differences"]
    assert len(differences) == 4, differences  # the body also differs when it is sent again


def test_every_script_compiles(godot: GodotProject) -> None:
    def check(script: str) -> str:
        done = subprocess.run(
            godot.command("--check-only", "-s", f"res://{script}"),
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        return done.stderr if done.returncode or "ERROR" in done.stderr else ""

    (godot.folder / "wrong.gd").write_text("extends Node\nfunc f():\n\tnobody_declared_this = 3\n", encoding="utf-8")
    assert "nobody_declared_this" in check("wrong.gd")
    (godot.folder / "wrong.gd").unlink()
    scripts = godot.scripts()
    assert "addons/foottrack/foottrack_client.gd" in scripts
    with ThreadPoolExecutor(2) as pool:
        assert [error for error in pool.map(check, scripts) if error] == []


def test_the_clock_is_the_service_s_own_method(godot: GodotProject) -> None:
    chance = random.Random(3)
    own, bursts, due = 0, [], []
    peer = SyncedClock(lambda: own)
    for number in range(60):
        # Drift within its bound, round trips that vary, and after 40 bursts a service with another clock.
        offset = 10**15 + number * 50_000 + (10**12 if number >= 40 else 0)
        burst = []
        for _ in range(8):
            trip = chance.choice([80_000, 300_000, 5_000_000, 200_000_000])
            burst.append(Exchange(own, own + offset + chance.randrange(trip), own + trip))
            own += trip
        peer.on_burst(burst)
        bursts.append([[str(value) for value in exchange] for exchange in burst])
        due.append([str(peer.offset), str(peer.uncertainty)])
        own += 2 * 10**9
    # The peer's uncertainty is that of `own` right after the burst.
    said = godot.run("time_sync.gd", json.dumps(bursts))
    assert said == due
