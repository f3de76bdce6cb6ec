"""The service on one host, a client behind the relay on another: two network namespaces, a bad cable, two clocks."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from curve_keys import client_toml, service_toml

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
COUNT = 100
DELAY_S = 0.02
LOSS = 0.02
CLOCKS_APART_S = 100_000
"""The other host has been up for longer."""
_SERVICE, _ENGINE = "10.77.0.1", "10.77.0.2"


class Hosts:
    """Two namespaces with a cable between them, and processes in them that end with the test."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self.names = (f"foottrack-a{os.getpid()}", f"foottrack-b{os.getpid()}")
        for name in self.names:
            _ip("netns", "add", name)
            stack.callback(_ip, "netns", "del", name)
        link = self._process([sys.executable, str(HERE / "lossy_link.py"), *self.names, str(DELAY_S), str(LOSS)])
        assert _line(link) == "up"

    def cable(self) -> None:
        """Plug it in at both ends."""
        for name, own, peer in zip(self.names, (_SERVICE, _ENGINE), (_ENGINE, _SERVICE), strict=True):
            _ip("-n", name, "addr", "add", own, "peer", peer, "dev", "link0")
            _ip("-n", name, "link", "set", "link0", "up")
            _ip("-n", name, "link", "set", "lo", "up")

    def run(self, host: int, *command: str) -> subprocess.Popen[str]:
        """A Python program on one of the hosts; the second has a clock of its own."""
        enter = ["ip", "netns", "exec", self.names[host]]
        if host == 1:
            enter += ["unshare", "--time", "--monotonic", str(CLOCKS_APART_S), "--fork", "--kill-child"]
        return self._process([*enter, sys.executable, *command])

    def _process(self, command: list[str]) -> subprocess.Popen[str]:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "protocol")])}
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=environment)
        self._stack.callback(process.__exit__, None, None, None)
        self._stack.callback(process.kill)
        return process


@pytest.fixture
def hosts() -> Iterator[Hosts]:
    """Skipped where namespaces cannot be made."""
    if sys.platform != "linux" or os.geteuid() != 0 or not all(map(shutil.which, ("ip", "unshare"))):
        pytest.skip("two hosts need Linux, root, ip and unshare")
    with ExitStack() as stack:
        try:
            subprocess.run(["unshare", "--time", "--monotonic", "1", "true"], check=True, capture_output=True)
            made = Hosts(stack)
        except (subprocess.CalledProcessError, AssertionError) as error:
            pytest.skip(f"no namespaces of network and time, or no TUN devices, here: {error}")
        made.cable()
        yield made


def test_a_client_behind_the_relay_loses_nothing_and_shares_the_clock(hosts: Hosts, tmp_path: Path) -> None:
    service_file, client_file = tmp_path / "service.toml", tmp_path / "client.toml"
    keys = service_toml(service_file, f"tcp://{_SERVICE}:7711")
    client_toml(client_file, keys)
    command = ["-c", "from foottrack_service.cli.main import main; main()"]
    service = hosts.run(0, *command, "run", "--config", str(service_file))
    _wait_for(service, "Listening")
    relay = hosts.run(1, *command, "relay", f"tcp://{_SERVICE}:7711", "--config", str(client_file))
    _wait_for(relay, "Listening")

    party = str(HERE / "network_party.py")
    parties = [
        hosts.run(0, party, "truth/left", "truth/right", str(COUNT)),
        hosts.run(1, party, "truth/right", "truth/left", str(COUNT)),
    ]
    assert [_line(each) for each in parties] == ["ready", "ready"]
    for each in parties:
        _tell(each)
    at_service, at_engine = (json.loads(_line(each)) for each in parties)
    for each in parties:
        _tell(each)

    half_of_longest_round_trip = 64_000_000
    assert abs(at_engine["offset"] + CLOCKS_APART_S * 1_000_000_000) <= half_of_longest_round_trip
    assert abs(at_service["offset"]) <= at_service["uncertainty"]
    for told in (at_service, at_engine):
        assert told["seq"] == list(range(COUNT))
        assert told["valid"] == COUNT
        # No packet is faster than the cable, and a clock of the other host would be a day off.
        assert min(told["delays"]) >= DELAY_S * 1e9 - half_of_longest_round_trip
        assert max(told["delays"]) < 60e9


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


def _line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    line = process.stdout.readline().strip()
    if not line:
        assert process.stderr is not None
        raise AssertionError(f"{process.args} ended: {process.stderr.read()}")
    return line


def _tell(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("go\n")
    process.stdin.flush()


def _wait_for(process: subprocess.Popen[str], word: str) -> None:
    assert process.stderr is not None
    heard = []
    for line in process.stderr:
        heard.append(line)
        if word in line:
            return
    raise AssertionError(f"{process.args} ended: {''.join(heard)}")
