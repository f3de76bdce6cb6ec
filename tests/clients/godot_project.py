"""The addon in a project of its own, and Godot 4 to run it: one that is installed, or the one in the cached Debian."""

from __future__ import annotations

import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

ROOT = Path(__file__).parents[2]
LINE = "LINE "
TIMEOUT_S = 40.0


class Godot(NamedTuple):
    """How Godot is called, and where it sees files: ``folder`` is /tmp of a root that it is locked into, or our own."""

    command: tuple[str, ...]
    folder: Path
    inside: Path


def find_godot() -> Godot | None:
    """FOOTTRACK_GODOT (an executable), or what install_godot.sh installed."""
    executable = os.environ.get("FOOTTRACK_GODOT")
    if executable:
        own = Path(tempfile.gettempdir())
        return Godot((executable,), own, own)
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    root = Path(os.environ.get("FOOTTRACK_GODOT_ROOT") or cache / "foottrack" / "godot-sid")
    if sys.platform != "linux" or not (root / "usr/bin/godot").exists():
        return None
    enter = ("chroot",) if os.geteuid() == 0 else ("unshare", "-r", "chroot")
    chroot = shutil.which("chroot", path=os.environ.get("PATH", "") + ":/usr/sbin:/sbin") or enter[-1]
    return Godot((*enter[:-1], chroot, str(root), "env", "HOME=/tmp", "godot"), root / "tmp", Path("/tmp"))


class GodotProject:
    """A copy of clients/godot with the tests' scripts and the golden vectors in it."""

    def __init__(self, godot: Godot) -> None:
        self._godot = godot

    def command(self, *arguments: str) -> list[str]:
        """Godot without a window, in this project."""
        return [*self._godot.command, "--headless", "--path", str(self._godot.inside / self.folder.name), *arguments]

    def run(self, script: str, *arguments: str) -> Any:
        """Run one of the tests' scripts to its end. What it says on its line of results."""
        done = subprocess.run(
            self.command("-s", f"res://tests/{script}", "--", *arguments),
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        lines = [line for line in done.stdout.splitlines() if line.startswith(LINE)]
        assert len(lines) == 1, f"{script} said no result:\n{done.stdout}\n{done.stderr}"
        assert "SCRIPT ERROR" not in done.stderr, done.stderr
        return json.loads(lines[0].removeprefix(LINE))

    def start(self, script: str, settings: dict[str, Any]) -> GodotRun:
        """Run a script that talks while it runs."""
        return GodotRun(self.command("-s", f"res://tests/{script}", "--", json.dumps(settings)))

    def scripts(self) -> list[str]:
        """All scripts of the addon and the example, and those of the tests."""
        return sorted(str(path.relative_to(self.folder)) for path in self.folder.rglob("*.gd"))

    def __enter__(self) -> Self:
        self.folder = Path(tempfile.mkdtemp(prefix="foottrack-", dir=self._godot.folder))
        shutil.copytree(
            ROOT / "clients/godot", self.folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".godot", "*.import")
        )
        shutil.copytree(Path(__file__).parent / "godot", self.folder / "tests")
        shutil.copytree(ROOT / "protocol/vectors", self.folder / "vectors")
        # With print's output held back, a test would wait for lines that were said long ago.
        (self.folder / "override.cfg").write_text("[application]\nrun/flush_stdout_on_print=true\n", encoding="utf-8")
        self.folder.chmod(0o755)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


class GodotRun:
    """A running Godot, or another client, and the lines of JSON that it says."""

    def __init__(self, command: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=environment)
        self._lines: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._said: list[str] = []
        self._readers = [threading.Thread(target=work, daemon=True) for work in (self._listen, self._complain)]
        for reader in self._readers:
            reader.start()

    def until(self, kind: str, **values: Any) -> dict[str, Any]:
        """The next line of a kind with these values; lines before it are gone."""
        while True:
            try:
                line = self._lines.get(timeout=TIMEOUT_S)
            except queue.Empty:
                line = None
            assert line is not None, f"the client did not say {kind} {values}:\n" + "\n".join(self._said)
            if line["kind"] == kind and all(line.get(key) == value for key, value in values.items()):
                return line

    def tell(self, line: str) -> None:
        """A line on its standard input."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def memory_kb(self) -> int:
        """Resident memory of the process."""
        status = Path(f"/proc/{self._process.pid}/status").read_text(encoding="utf-8")
        return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait()
        for reader in self._readers:
            reader.join()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        errors = [line for line in self._said if "SCRIPT ERROR" in line]
        assert not errors, "\n".join(self._said)

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for text in self._process.stdout:
            if text.startswith(LINE):
                self._lines.put(json.loads(text.removeprefix(LINE)))
            self._said.append(text.rstrip())
        self._lines.put(None)

    def _complain(self) -> None:
        assert self._process.stderr is not None
        self._said.extend(text.rstrip() for text in self._process.stderr)
