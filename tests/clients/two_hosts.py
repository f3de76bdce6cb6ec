"""Two hosts in one: network namespaces with a bad cable between them, and two clocks (Linux, root)."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

ROOT = Path(__file__).parents[2]
DELAY_S = 0.02
LOSS = 0.02
CLOCKS_APART_S = 100_000
"""The second host has been up for longer."""
FIRST, SECOND = "10.77.0.1", "10.77.0.2"
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": os.pathsep.join(str(ROOT / part) for part in (".", "clients/python", "protocol")),
}


class Hosts:
    """Both, with the cable plugged in. Processes of ``run`` end with the stack."""

    def __init__(self, stack: ExitStack) -> None:
        """Raises CalledProcessError, AssertionError where the kernel or the user may not."""
        self._stack = stack
        subprocess.run(["unshare", "--time", "--monotonic", "1", "true"], check=True, capture_output=True)
        self.names = (f"foottrack-a{os.getpid()}", f"foottrack-b{os.getpid()}")
        for name in self.names:
            _ip("netns", "add", name)
            stack.callback(_ip, "netns", "del", name)
        program = str(Path(__file__).with_name("lossy_link.py"))
        link = self._process([sys.executable, program, *self.names, str(DELAY_S), str(LOSS)])
        assert link.stdout is not None and link.stdout.readline().strip() == "up"
        for name, own, peer in zip(self.names, (FIRST, SECOND), (SECOND, FIRST), strict=True):
            _ip("-n", name, "addr", "add", own, "peer", peer, "dev", "link0")
            _ip("-n", name, "link", "set", "link0", "up")
            _ip("-n", name, "link", "set", "lo", "up")

    def enter(self, host: int) -> list[str]:
        """What a command on one of the hosts begins with; the second has a clock of its own."""
        enter = ["ip", "netns", "exec", self.names[host]]
        if host == 1:
            enter += ["unshare", "--time", "--monotonic", str(CLOCKS_APART_S), "--fork", "--kill-child"]
        return enter

    def foottrack(self, host: int, *arguments: str) -> None:
        """A command of foottrack on one of the hosts, as soon as it listens."""
        main = "from foottrack_service.cli.main import main; main()"
        process = self._process([*self.enter(host), sys.executable, "-c", main, *arguments])
        assert process.stderr is not None
        heard = []
        for line in process.stderr:
            heard.append(line)
            if "Listening" in line:
                return
        raise AssertionError(f"foottrack {arguments} ended: {''.join(heard)}")

    def _process(self, command: list[str]) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=ENVIRONMENT)
        self._stack.callback(process.__exit__, None, None, None)
        self._stack.callback(process.kill)
        return process


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)
