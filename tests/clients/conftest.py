"""What the clients are tested against: the service on ports of its own, a server that lies, a real Godot, mono."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from fake_service import FakeService
from godot_project import GodotProject, find_godot
from live_service import LiveService
from unity_mono import MISSING, UnityPackage, has_mono


@pytest.fixture
def service() -> Iterator[LiveService]:
    """The service, running; a test may stop and start it."""
    with LiveService() as made:
        yield made


@pytest.fixture
def fake() -> Iterator[FakeService]:
    """A server on a plain socket that says what the test says."""
    with FakeService() as made:
        yield made


@pytest.fixture(scope="session")
def godot() -> Iterator[GodotProject]:
    """The addon and the tests' scripts in a project that Godot can run; skipped where there is no Godot 4."""
    found = find_godot()
    if found is None:
        pytest.skip("no Godot 4: run tests/clients/install_godot.sh, or set FOOTTRACK_GODOT to an executable")
    with GodotProject(found) as made:
        yield made


@pytest.fixture(scope="session")
def unity(tmp_path_factory: pytest.TempPathFactory) -> UnityPackage:
    """The Unity package and its tests, compiled for mono; skipped where there is none."""
    if not has_mono():
        pytest.skip(MISSING)
    return UnityPackage(tmp_path_factory.mktemp("unity") / "tests.exe")
