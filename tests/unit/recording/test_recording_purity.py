"""Reading and writing files needs neither sockets nor an event loop."""

from __future__ import annotations

import subprocess
import sys

PURE = ("writer", "reader", "recover", "compare", "export", "importer", "replay", "file", "info")


def test_what_only_reads_and_writes_imports_no_socket_and_no_event_loop() -> None:
    lines = [f"import foottrack_service.recording.{name}" for name in PURE]
    lines.append("import sys; print(sorted({'zmq', 'asyncio', 'numpy'} & set(sys.modules)))")
    said = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
