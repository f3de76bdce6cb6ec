"""The warm-up compiles all that a stream needs: the first sample, the first gap and the first fix cost what all do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import sys
import numpy as np
from foottrack_service.config import FootSettings, Settings
from foottrack_service.fusion import foot_filter
from foottrack_service.fusion.core import FusionCore
from foottrack_service.fusion.offline import fuse
from foottrack_service.simulation import faults
from foottrack_service.simulation.scenario import simulate

def compiled():
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith("foottrack_service."):
            for key, value in vars(module).items():
                if hasattr(value, "nopython_signatures"):
                    found[value.py_func.__qualname__] = len(value.nopython_signatures)
    return found

foot_filter.warm_up()
before = compiled()
assert sum(before.values()) >= 5, before
gap = (faults.CameraBlackout(start=2.0, end=2.6), faults.ImuDropout(side="left", start=3.0, end=3.4))
for kind in ("fused", "raw"):
    for _ in fuse(simulate("steps", 3, seconds=4.5, imu=kind, faults=gap).messages(), FusionCore(Settings())):
        pass
after = compiled()
assert after == before, {name: count for name, count in after.items() if count != before.get(name)}
"""


def test_nothing_is_left_to_compile_in_the_middle_of_a_stream() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr


ASKED = """
import numpy as np
from foottrack_service.camera import pose_kernel
from foottrack_service.compiled import is_compiled
assert not is_compiled(pose_kernel.fit_both) and not is_compiled(pose_kernel._quaternion)
pose_kernel._quaternion(np.eye(3), np.empty(4))
assert is_compiled(pose_kernel._quaternion)
assert not is_compiled(pose_kernel.fit_both), "another kernel's cache was taken for its own"
"""


def test_what_one_kernel_left_in_the_cache_says_nothing_of_another(tmp_path: Path) -> None:
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    done = subprocess.run([sys.executable, "-c", ASKED], capture_output=True, text=True, env=env, check=False)
    assert done.returncode == 0, done.stderr
