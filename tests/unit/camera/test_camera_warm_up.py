"""The warm-up compiles all that pictures need: the first tag in view, mapped from a file, waits for nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
from camera_scenes import looking_down, stepping, world

CODE = """
import sys
from pathlib import Path
from foottrack_service.camera.marker_tracker import warm_up
from foottrack_service.camera.setup import Trackers
from foottrack_service.camera.sources.folder import FolderSource
from foottrack_service.camera.rig import D435_COLOUR
from foottrack_service.config import Settings

def compiled():
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith("foottrack_service."):
            for key, value in vars(module).items():
                if hasattr(value, "nopython_signatures"):
                    found[value.py_func.__qualname__] = len(value.nopython_signatures)
    return found

warm_up()
before = compiled()
assert sum(before.values()) >= 5, before
source = FolderSource(Path(sys.argv[1]), D435_COLOUR, 0.003, 1000.0)
trackers = Trackers(Settings().camera, D435_COLOUR)
found = [len(trackers.process(source.read())) for _ in range(3)]
assert min(found) >= 2, found
after = compiled()
assert after == before, {name: count for name, count in after.items() if count != before.get(name)}
"""


def test_nothing_is_left_to_compile_when_a_tag_comes_into_view(tmp_path: Path) -> None:
    made = world(looking_down(), {"left": stepping(-0.11, 0.0), "right": stepping(0.11, 0.5)})
    for number in range(3):
        frame = made.frame(number)
        assert frame.depth is not None
        np.save(tmp_path / f"rgb-{number}.npy", frame.gray)
        np.save(tmp_path / f"depth-{number}.npy", frame.depth)
    for kind in ("rgb", "depth"):
        lines = [f"{number / 60.0:.6f} {kind}-{number}.npy" for number in range(3)]
        (tmp_path / f"{kind}.txt").write_text("\n".join(lines), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(tmp_path)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
