"""The Unity package without a service: its core compiles alone, every golden vector, no memory per message."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from unity_metas import guid_of, metas
from unity_mono import MISSING, NURSERY_BYTES, PACKAGE, ROOT, UnityPackage, compile_csharp, frames_line, has_mono

VECTORS = ROOT / "protocol/vectors"
MESSAGES = 20_000
RAW = "user/raw/"
"""Streams that SPEC lets a client leave out, as this one does: it refuses their topics."""

needs_mono = pytest.mark.skipif(not has_mono(), reason=MISSING)


def vectors(*names: str) -> list[dict[str, Any]]:
    """All vectors, or those of these files."""
    paths = [VECTORS / f"{name}.json" for name in names] or sorted(VECTORS.glob("*.json"))
    return [vector for path in paths for vector in json.loads(path.read_text(encoding="utf-8"))["vectors"]]


def line_of(vector: dict[str, Any]) -> str:
    frames = list(vector["frames_hex"] if "reason" in vector else (vector["topic_hex"], vector["payload_hex"]))
    zeros = vector.get("payload_zeros", 0) + vector.get("last_frame_zeros", 0)
    if zeros:
        frames[-1] += "00" * zeros
    return frames_line(frames)


def is_raw(vector: dict[str, Any]) -> bool:
    first = vector["frames_hex"][:1] if "frames_hex" in vector else [vector["topic_hex"]]
    return bytes.fromhex("".join(first)).startswith(RAW.encode())


def differs(due: Any, found: Any, place: str) -> str | None:
    """Where two values differ, floats by more than SPEC allows."""
    if isinstance(due, dict) and isinstance(found, dict) and due.keys() == found.keys():
        return next((at for key in due if (at := differs(due[key], found[key], f"{place}.{key}"))), None)
    if isinstance(due, list) and isinstance(found, list) and len(due) == len(found):
        pairs = enumerate(zip(due, found, strict=True))
        return next((at for i, (a, b) in pairs if (at := differs(a, b, f"{place}[{i}]"))), None)
    if isinstance(due, float) and type(found) in (int, float):
        return None if math.isclose(due, found, rel_tol=1e-9, abs_tol=1e-9) else f"{place}: {found}, not {due}"
    return None if type(due) is type(found) and due == found else f"{place}: {found!r}, not {due!r}"


def fault_of(vector: dict[str, Any], found: dict[str, Any]) -> str | None:
    """What is wrong with what the package made of a vector."""
    if "reason" in vector or is_raw(vector):
        due = "topic" if is_raw(vector) else vector["reason"]
        return None if found == {"refusal": due} else f"{vector['name']}: {found}, not {due}"
    if "refusal" in found:
        return f"{vector['name']}: refused, {found['refusal']}"
    message = {key: value for key, value in vector["message"].items() if key not in ("v", "data")}
    due = {"topic": vector["topic"], "envelope": message, "data": vector["message"]["data"]}
    return differs(due, found, vector["name"])


def decoded(unity: UnityPackage, folder: Path, chosen: list[dict[str, Any]]) -> list[dict[str, Any]]:
    path = folder / "messages.txt"
    path.write_text("".join(line_of(vector) + "\n" for vector in chosen), encoding="ascii")
    found = unity.run("vectors", str(path))
    assert len(found) == len(chosen)
    return found


@needs_mono
@pytest.mark.engine
def test_the_core_compiles_alone_and_without_a_warning(tmp_path: Path) -> None:
    assert (
        compile_csharp(["Runtime/Core"], tmp_path / "core.dll", "-target:library", "-noconfig", "-r:System.dll") == ""
    )


@pytest.mark.engine
def test_every_golden_vector_is_understood_or_refused_for_its_reason(unity: UnityPackage, tmp_path: Path) -> None:
    chosen = vectors()
    found = decoded(unity, tmp_path, chosen)
    faults = [fault for vector, said in zip(chosen, found, strict=True) if (fault := fault_of(vector, said))]
    assert faults == []
    assert sum("refusal" not in said for said in found) > 100


@pytest.mark.engine
def test_a_vector_that_is_wrong_is_noticed(unity: UnityPackage, tmp_path: Path) -> None:
    pose, session, invalid = vectors("body_pose")[0], vectors("session")[0], vectors("invalid")[0]
    found = decoded(unity, tmp_path, [pose, session, invalid])
    pose["message"]["data"]["left"]["ankle"]["p"][1] += 1e-8
    session["message"]["src"] = "somebody else"
    invalid["reason"] = "body"
    assert all(fault_of(vector, said) for vector, said in zip([pose, session, invalid], found, strict=True))


@pytest.mark.engine
def test_what_unity_s_own_test_runner_would_run(unity: UnityPackage) -> None:
    said = unity.run("tests")
    assert [line["fault"] for line in said if line["fault"]] == []
    written = [
        method
        for path in (PACKAGE / "Tests/Editor").glob("*.cs")
        for method in re.findall(r"\[Test\]\s+public void (\w+)", path.read_text(encoding="utf-8"))
    ]
    assert sorted(line["test"].rpartition(".")[2] for line in said) == sorted(written) != []


@pytest.mark.engine
def test_a_message_takes_no_memory(unity: UnityPackage, tmp_path: Path) -> None:
    hot = [vectors(name)[0] for name in ("body_pose", "ik_targets", "gait_state", "gait_event")]
    path = tmp_path / "messages.txt"
    path.write_text("".join(line_of(vector) + "\n" for vector in [*hot, vectors("health")[0]]), encoding="ascii")
    *measured, control = unity.run("allocations", str(path), str(MESSAGES))
    for said in measured:
        assert said["decoded"] > MESSAGES
        # Less garbage than would make the collector run: the smallest object of C# has 16 bytes.
        assert said["collections"] == 0 < NURSERY_BYTES < MESSAGES * 16
    # A body that does allocate shows that the measure can tell.
    assert control["collections"] > 0


def test_the_package_is_one_that_unity_takes() -> None:
    package = json.loads((PACKAGE / "package.json").read_text(encoding="utf-8"))
    assert re.fullmatch(r"[a-z0-9.-]+", package["name"]) and re.fullmatch(r"\d+\.\d+\.\d+", package["version"])
    assert all((PACKAGE / sample["path"]).is_dir() for sample in package["samples"])
    definitions = {path: json.loads(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.asmdef")}
    own = {definition["name"] for definition in definitions.values()}
    core = next(definition for definition in definitions.values() if definition["name"] == "Foottrack.Core")
    assert core["noEngineReferences"] and core["references"] == []
    for definition in definitions.values():
        assert {name for name in definition["references"] if name.startswith("Foottrack")} <= own


def test_every_asset_has_its_meta_file_with_an_id_of_its_own() -> None:
    """In a package that Unity got from a registry or by git, an asset without one is ignored."""
    due = metas()
    there = set(PACKAGE.rglob("*.meta"))
    assert {path for path in due if path not in there} == set(), "run python tests/clients/unity_metas.py"
    assert there - due.keys() == set()
    ids = [guid_of(path) for path in there]
    assert len(set(ids)) == len(ids) and all(re.fullmatch("[0-9a-f]{32}", found) for found in ids)
