"""The exports as others read them: three.js's BVHLoader and GLTFLoader, and Khronos's validator, in node."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foottrack_service.walkcycle.bvh import format_bvh
from foottrack_service.walkcycle.cycle import build_cycle
from foottrack_service.walkcycle.frames import even_frames
from foottrack_service.walkcycle.glb import format_glb, key_times
from foottrack_service.walkcycle.path import parse_path
from foottrack_service.walkcycle.presets import PRESETS, preset
from foottrack_service.walkcycle.skeleton import INDEX, JOINTS, forward_kinematics
from foottrack_service.walkcycle.walk import Motion, Walk, walk_along

pytestmark = pytest.mark.engine

SOURCES = Path(__file__).parent.parent / "walkcycle_node"


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with read.mjs and what it needs, installed as its lock file says."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("node and npm are not installed: third-party readers of BVH and glTF were not asked")
    folder = tmp_path_factory.mktemp("node")
    for name in ("package.json", "package-lock.json", "read.mjs"):
        shutil.copy(SOURCES / name, folder / name)
    done = subprocess.run(
        [npm, "ci", "--no-audit", "--no-fund", "--ignore-scripts"],
        check=False,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=150,
    )
    if done.returncode != 0:
        pytest.skip(f"npm could not install three and gltf-validator: {done.stderr.strip()[-200:]}")
    return folder


def _read(reader: Path, file: Path, times: np.ndarray) -> dict[str, Any]:
    words = ["node", "read.mjs", str(file), *(f"{time:.9f}" for time in times)]
    done = subprocess.run(words, cwd=reader, capture_output=True, text=True, timeout=60, check=True)
    return json.loads(done.stdout)  # type: ignore[no-any-return]


def _walk(name: str) -> Walk:
    return walk_along(build_cycle(preset(name)), parse_path("circle:1.5,120"))


def _places(walk: Walk, motion: Motion, index: int) -> np.ndarray:
    places, _ = forward_kinematics(walk.body.offsets, motion.hips, motion.rotations)
    return places[index]


@pytest.mark.parametrize("name", PRESETS)
def test_three_reads_our_glb_and_the_validator_finds_nothing(reader: Path, tmp_path: Path, name: str) -> None:
    walk = _walk(name)
    motion = walk.motion(key_times(walk, 30.0))
    file = tmp_path / "walk.glb"
    file.write_bytes(format_glb(walk.body, motion, name))
    chosen = [0, 20, len(motion.times) // 2, len(motion.times) - 2]
    found = _read(reader, file, motion.times[chosen])
    assert (found["issues"]["numErrors"], found["issues"]["numWarnings"]) == (0, 0), found["issues"]["messages"]
    assert found["skinned"] == [len(JOINTS)]
    assert found["duration"] == pytest.approx(walk.duration, abs=1e-4)
    _compare(walk, motion, chosen, found)


def test_three_reads_our_bvh(reader: Path, tmp_path: Path) -> None:
    walk = _walk("normative")
    motion = even_frames(walk, 60.0).motion(walk)
    file = tmp_path / "walk.bvh"
    file.write_text(format_bvh(walk.body, motion))
    chosen = [0, 33, 120, len(motion.times) - 2]
    _compare(walk, motion, chosen, _read(reader, file, motion.times[chosen]))


def _compare(walk: Walk, motion: Motion, chosen: list[int], found: dict[str, Any]) -> None:
    for index, places in zip(chosen, found["places"], strict=True):
        assert set(places) >= set(JOINTS)
        ours = _places(walk, motion, index)
        for joint in JOINTS:
            # 0.02 mm: three keeps times and tracks in single precision, and a foot in swing goes 4 m/s.
            assert places[joint] == pytest.approx(ours[INDEX[joint]], abs=2e-5), joint
