"""A decoder in another language that knows SPEC.md and nothing else: its tables are read, its prose is in `spec_node`.

It was written without a look at the code. What it cannot know from SPEC.md is SPEC.md's fault, and mended there.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from foottrack_protocol import Reason
from foottrack_protocol.generate import FOLDER

pytestmark = pytest.mark.engine

READER = Path(__file__).parents[1] / "spec_node" / "vectors.mjs"
SPEC, VECTORS = FOLDER / "SPEC.md", FOLDER / "vectors"


def read(spec: Path, vectors: Path) -> dict[str, Any]:
    """How many vectors of each kind the decoder read, the reasons it knows, and what it understood differently."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the decoder that knows only SPEC.md was not run")
    done = subprocess.run(
        [node, str(READER), str(spec), str(vectors)], check=False, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def how_many(name: str) -> int:
    files = [path for path in VECTORS.rglob("*.json") if (path.name == "invalid.json") is (name == "invalid")]
    return sum(len(json.loads(path.read_text(encoding="utf-8"))["vectors"]) for path in files)


def test_every_vector_is_understood_or_refused_for_its_reason() -> None:
    found = read(SPEC, VECTORS)
    assert found["differences"] == []
    assert found["valid"] == how_many("valid") > 100
    assert found["invalid"] == how_many("invalid") > 300
    assert found["reasons"] == list(Reason)


@pytest.mark.parametrize(
    ("says", "instead"),
    [
        ("| `accuracy` | int >= 0, <= 3 |", "| `accuracy` | int |"),
        ("| `edge_px` | float |", "| `edge_px` | int |"),
        ('| `kind` | `"floor"` |', '| `kind` | `"ground"` |'),
        ("| float | m/s | required | the ankle's, upwards |", "| float | m/s | may be nil or absent | |"),
        ("| payload | 262144 bytes |", "| payload | 1000 bytes |"),
        ("| `<user>/depth/right` |", "| `<user>/depth/middle` |"),
    ],
)
def test_a_specification_that_says_something_else_is_noticed(tmp_path: Path, says: str, instead: str) -> None:
    text = SPEC.read_text(encoding="utf-8")
    assert text.count(says) == 1
    other = tmp_path / "SPEC.md"
    other.write_text(text.replace(says, instead), encoding="utf-8")
    assert read(other, VECTORS)["differences"]


def test_a_vector_that_is_wrong_is_noticed(tmp_path: Path) -> None:
    vectors = tmp_path / "vectors"
    shutil.copytree(VECTORS, vectors)
    truth, invalid = vectors / "truth.json", vectors / "invalid.json"
    truth.write_text(truth.read_text(encoding="utf-8").replace('"src": "golden"', '"src": "other"'), encoding="utf-8")
    invalid.write_text(
        invalid.read_text(encoding="utf-8").replace('"reason": "depth"', '"reason": "body"'), encoding="utf-8"
    )
    assert len(read(SPEC, vectors)["differences"]) == 3 + 4
