"""The protocol is a package that others can take alone: it needs msgpack, pydantic and Python."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import foottrack_protocol

PACKAGE = Path(foottrack_protocol.__file__).parent
ALLOWED = {"foottrack_protocol", "msgpack", "pydantic", *sys.stdlib_module_names}


def imported(source: str) -> Iterator[str]:
    """Top-level names of all modules that a source imports, also inside functions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "foottrack_protocol" if node.level else (node.module or "").partition(".")[0]


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_imports_only_msgpack_pydantic_and_the_standard_library(path: Path) -> None:
    assert set(imported(path.read_text(encoding="utf-8"))) <= ALLOWED


def test_importing_it_loads_neither_numpy_nor_sockets() -> None:
    code = (
        "import foottrack_protocol, foottrack_protocol.control, sys;"
        "print(sorted({'numpy', 'zmq', 'asyncio', 'foottrack_service'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
