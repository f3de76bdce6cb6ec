"""A real OpenXR runtime: Monado's simulated headset, without pictures."""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foottrack_service.bus import Bus
from foottrack_service.config import Settings
from foottrack_service.headset import node

RUNTIME = Path(os.environ.get("XR_RUNTIME_JSON", "/usr/share/openxr/1/openxr_monado.json"))
START_TIMEOUT_S = 20.0

pytestmark = [
    pytest.mark.skipif(find_spec("xr") is None, reason="the extra 'openxr' is not installed"),
    pytest.mark.skipif(
        shutil.which("monado-service") is None or not RUNTIME.exists(),
        reason="Monado is not installed (monado-service, libopenxr1-monado, mesa-vulkan-drivers)",
    ),
]

Run = Callable[[Any], Any]


@pytest.fixture
def monado(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The service with a headset that wobbles about."""
    for name, value in {
        "XDG_RUNTIME_DIR": str(tmp_path),
        "XR_RUNTIME_JSON": str(RUNTIME),
        "XRT_COMPOSITOR_NULL": "1",
        "SIMULATED_ENABLE": "1",
        "XRT_NO_STDIN": "1",
    }.items():
        monkeypatch.setenv(name, value)
    with (tmp_path / "log").open("w") as log:
        process = subprocess.Popen(["monado-service"], stdout=log, stderr=log)
        try:
            deadline = time.monotonic() + START_TIMEOUT_S
            while not (tmp_path / "monado_comp_ipc").exists():
                assert process.poll() is None and time.monotonic() < deadline, (tmp_path / "log").read_text()
                time.sleep(0.05)
            yield
        finally:
            process.kill()
            process.wait()


def test_its_head_moves_on_the_bus(run: Run, bus: Bus, monado: None) -> None:
    # It calls its positions valid, but not tracked.
    given = Settings(headset={"source": "openxr", "openxr": {"inferred": True}})

    async def play() -> list[Any]:
        subscriber = bus.subscriber(["user/head"])
        await subscriber.ready()
        task = asyncio.ensure_future(node.run(bus, given))
        messages = []
        async for received in subscriber:
            messages.append(received.message)
            if len(messages) == 120:
                break
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return messages

    messages = run(play())
    assert all(message.data.tracked for message in messages)
    assert {message.data.origin for message in messages} == {0}
    t = np.array([message.t for message in messages])
    p = np.array([message.data.p for message in messages])
    assert np.all(np.diff(t) > 0)
    late = np.array([message.t_pub for message in messages]) - t
    assert np.all(late >= 0) and np.median(late) < 20e6
    assert np.all((p[:, 1] > 1.0) & (p[:, 1] < 2.2))
    assert np.ptp(p, axis=0).max() > 0.01
    speed = np.linalg.norm(np.diff(p, axis=0), axis=1) / (np.diff(t) * 1e-9)
    assert speed.max() < 2.0


def test_what_it_only_infers_is_not_tracked_unless_wanted(run: Run, bus: Bus, monado: None) -> None:
    async def play() -> Any:
        subscriber = bus.subscriber(["user/head"])
        await subscriber.ready()
        task = asyncio.ensure_future(node.run(bus, Settings(headset={"source": "openxr"})))
        received = await anext(aiter(subscriber))
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        return received.message.data

    assert not run(play()).tracked
