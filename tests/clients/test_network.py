"""The service on one host, a client of each kind behind the relay on another: CURVE, a bad cable, two clocks."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from client_traffic import ports
from godot_project import GodotProject, GodotRun
from two_hosts import CLOCKS_APART_S, DELAY_S, ENVIRONMENT, FIRST, Hosts
from typer.testing import CliRunner
from unity_mono import UnityPackage

from foottrack_client import Endpoints
from foottrack_service.cli.main import app

HERE = Path(__file__).parent
HEADS, EVENTS = 50, 100
HALF_OF_LONGEST_ROUND_TRIP_NS = 64_000_000
"""A clock is not known worse than that (SPEC, section 3)."""


@pytest.fixture(scope="module")
def hosts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hosts]:
    """The service at its default ports on the first, a relay to it on the second; skipped where none can be made."""
    if sys.platform != "linux" or os.geteuid() != 0 or not all(map(shutil.which, ("ip", "unshare"))):
        pytest.skip("two hosts need Linux, root, ip and unshare")
    folder = tmp_path_factory.mktemp("keys")
    done = CliRunner().invoke(app, ["keys", "new", "--folder", str(folder / "keys")])
    for name, text in zip(("service.toml", "client.toml"), done.stdout.split("\n\n"), strict=True):
        (folder / name).write_text(text, encoding="utf-8")
    with ExitStack() as stack:
        try:
            made = Hosts(stack)
        except (subprocess.CalledProcessError, AssertionError) as error:
            pytest.skip(f"no namespaces of network and time, or no TUN devices, here: {error}")
        made.foottrack(0, "run", "--config", str(folder / "service.toml"))
        made.foottrack(1, "relay", f"tcp://{FIRST}:7711", "--config", str(folder / "client.toml"))
        yield made


def over_the_network(hosts: Hosts, source: str, command: list[str]) -> dict[str, Any]:
    """Runs a client on the second host until it has what was sent to it; its last word."""
    program = [sys.executable, str(HERE / "network_party.py"), source, str(HEADS), str(EVENTS)]
    with (
        GodotRun([*hosts.enter(0), *program], ENVIRONMENT) as party,
        GodotRun([*hosts.enter(1), *command], ENVIRONMENT) as client,
    ):
        party.until("ready")
        client.until("connected")
        client.until("frames", synchronised=True)
        heads = party.until("heads")
        party.tell("go")
        said = client.until("final")
        party.tell("end")
    # Lossy as the cable is: TCP brings all of it, in order.
    assert heads["seqs"] == list(range(heads["seqs"][0], heads["seqs"][0] + HEADS))
    # No packet is faster than the cable, and a clock of the other host would be a day off.
    assert min(heads["delays_ns"]) >= DELAY_S * 1e9 - HALF_OF_LONGEST_ROUND_TRIP_NS
    assert max(heads["delays_ns"]) < 60e9
    assert said["steps"] == list(range(EVENTS))
    for topic in ("user/gait/event", "user/pose/body"):
        assert said["statistics"]["topics"][topic]["gaps"] == 0
    return said


def test_python(hosts: Hosts) -> None:
    said = over_the_network(
        hosts, "python", [sys.executable, str(HERE / "python_game.py"), json.dumps(Endpoints()), "other"]
    )
    offset = said["statistics"]["offset_ns"]
    assert abs(offset + CLOCKS_APART_S * 1_000_000_000) <= HALF_OF_LONGEST_ROUND_TRIP_NS


@pytest.mark.engine
def test_godot(hosts: Hosts, godot: GodotProject) -> None:
    settings = json.dumps({**ports(Endpoints()), "head": True})
    over_the_network(hosts, "godot", godot.command("-s", "res://tests/client.gd", "--", settings))


@pytest.mark.engine
def test_unity_s_core(hosts: Hosts, unity: UnityPackage) -> None:
    over_the_network(hosts, "unity", unity.play_command(Endpoints()))
