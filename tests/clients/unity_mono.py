"""The Unity package under mono: compiled with the tests' own runner and stubs of the engine, and run."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from godot_project import LINE, TIMEOUT_S, GodotRun

from foottrack_client import Endpoints

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "clients/unity"
NURSERY_BYTES = 64 * 1024
"""Garbage that makes mono's collector run. Its usual 4 MiB would hide small objects."""
MISSING = "no mono: run tests/clients/install_mono.sh (Debian: mono-mcs, mono-runtime)"


def has_mono() -> bool:
    """Whether there are a compiler and a runtime."""
    return shutil.which("mcs") is not None and shutil.which("mono") is not None


def compile_csharp(folders: Iterable[str], made: Path, *options: str) -> str:
    """The C# of these folders of the package, every warning an error. What the compiler says; empty: nothing."""
    sources = sorted(str(path) for folder in folders for path in (PACKAGE / folder).rglob("*.cs"))
    assert sources
    done = subprocess.run(
        ["mcs", "-langversion:7", "-warn:4", "-warnaserror", f"-out:{made}", *options, *sources],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    return done.stdout + done.stderr if done.returncode else ""


class UnityPackage:
    """The package and its tests as a program."""

    def __init__(self, program: Path) -> None:
        self._program = program
        said = compile_csharp(["Runtime", "Samples~", "Tests"], program)
        assert said == "", said

    def run(self, *arguments: str) -> list[dict[str, Any]]:
        """Run a command to its end. Its lines."""
        done = subprocess.run(
            ["mono", str(self._program), *arguments],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
            env={**os.environ, "MONO_GC_PARAMS": f"nursery-size={NURSERY_BYTES // 1024}k"},
        )
        assert done.returncode == 0, done.stderr
        lines = done.stdout.splitlines()
        return [json.loads(line.removeprefix(LINE)) for line in lines if line.startswith(LINE)]

    def play(self, endpoints: Endpoints, follow: str = "Tracked") -> GodotRun:
        """A game that talks while it runs."""
        return GodotRun(self.play_command(endpoints, follow))

    def play_command(self, endpoints: Endpoints, follow: str = "Tracked") -> list[str]:
        """What runs that game."""
        return ["mono", "--debug", str(self._program), "game", *ports_of(endpoints), follow]

    def requests(self, endpoints: Endpoints, timeout_ms: int, *asked: str) -> GodotRun:
        """A program that asks all of it at once and tells the answers."""
        return GodotRun(
            ["mono", "--debug", str(self._program), "requests", *ports_of(endpoints), str(timeout_ms), *asked]
        )

    def bench(self, endpoints: Endpoints, manner: str) -> GodotRun:
        """A game that measures, and says nothing ("quiet") or its counters ("talk") until it ends."""
        nursery = f"--gc-params=nursery-size={NURSERY_BYTES // 1024}k"
        return GodotRun(["mono", nursery, str(self._program), "bench", *ports_of(endpoints), manner])


def ports_of(endpoints: Endpoints) -> Sequence[str]:
    """Ingress, egress, control."""
    return [endpoint.rpartition(":")[2] for endpoint in endpoints]


def frames_line(frames: Iterable[str]) -> str:
    """Frames in hexadecimal, as the program takes a message."""
    return "".join(frame + " " for frame in frames)
