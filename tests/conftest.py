"""What all tests share: a ZeroMQ context that cannot hang, a bus on ports of its own, coroutines run to their end."""

from __future__ import annotations

import asyncio
import logging
import os
import sys
import threading
from collections.abc import Callable, Coroutine, Generator, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest
import zmq

from foottrack_service.bus import Broker, Bus
from foottrack_service.bus.endpoints import Context
from foottrack_service.calibration.store import FOLDER_VARIABLE
from foottrack_service.config import BusSettings

EPHEMERAL = BusSettings(ingress="tcp://127.0.0.1:0", egress="tcp://127.0.0.1:0", control="tcp://127.0.0.1:0")
LEAK_TIMEOUT_S = 5.0
TEST_TIMEOUT_S = 30.0
LIVE = ("clients", "integration")
"""Folders whose tests wait for processes, sockets and devices, and would wait for each other."""

T = TypeVar("T")
Run = Callable[[Coroutine[Any, Any, T]], T]


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--update-golden``: write the golden results of tests/replay anew."""
    parser.addoption("--update-golden", action="store_true", help="write the golden results of tests/replay anew")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """With several workers (``pytest -n``), tests that live in real time share one, a folder at a time."""
    here = Path(__file__).parent
    for item in items:
        folder = item.path.relative_to(here).parts[0]
        if folder in LIVE:
            item.add_marker(pytest.mark.xdist_group(folder))


@pytest.hookimpl(wrapper=True)
def pytest_report_to_serializable() -> Generator[None, dict[str, Any] | None, dict[str, Any] | None]:
    """Half characters, which some tests send and log, do not pass between pytest's processes."""
    return _whole((yield))


@pytest.fixture(scope="session", autouse=True)
def _nobodys_calibrations(tmp_path_factory: pytest.TempPathFactory) -> None:
    """No test knows what the person who runs it has calibrated."""
    os.environ[FOLDER_VARIABLE] = str(tmp_path_factory.mktemp("calibrations"))


@pytest.fixture(autouse=True)
def _logging_ends_with_its_command() -> Iterator[None]:
    """A command that is run within a test logs to a stream that is closed with it."""
    yield
    root = logging.getLogger()
    for handler in [each for each in root.handlers if type(each) is logging.StreamHandler]:
        root.removeHandler(handler)


@pytest.fixture(scope="session", autouse=True)
def _selector_loop() -> None:
    """Windows: pyzmq's descriptors need the selector loop, as in the service."""
    if sys.platform == "win32":
        asyncio.set_event_loop_policy(asyncio.WindowsSelectorEventLoopPolicy())


@pytest.fixture
def run() -> Run[Any]:
    """Runs a coroutine in a new event loop; one that does not end fails the test."""

    def _run(coroutine: Coroutine[Any, Any, T]) -> T:
        async def limited() -> T:
            async with asyncio.timeout(TEST_TIMEOUT_S):
                return await coroutine

        return asyncio.run(limited())

    return _run


@pytest.fixture
def context() -> Iterator[Context]:
    """A context; a socket that a test leaves open fails it instead of hanging it."""
    made: Context = zmq.Context()
    made.linger = 0
    yield made
    end = threading.Thread(target=made.term, daemon=True)
    end.start()
    end.join(LEAK_TIMEOUT_S)
    if end.is_alive():
        pytest.fail("the test left a ZeroMQ socket open")


@pytest.fixture
def broker(context: Context) -> Iterator[Broker]:
    """A running broker: ``broker.endpoints`` over TCP, ``broker.inproc`` in the context."""
    with Broker(EPHEMERAL, context) as made:
        yield made


@pytest.fixture
def bus(broker: Broker, context: Context) -> Iterator[Bus]:
    """A connection to that broker over TCP, as another process has it."""
    with Bus.connect(broker.endpoints, context) as made:
        yield made


def _whole(value: Any) -> Any:
    match value:
        case str():
            return value.encode(errors="backslashreplace").decode()
        case dict():
            return {key: _whole(item) for key, item in value.items()}
        case list() | tuple():
            return type(value)(_whole(item) for item in value)
        case _:
            return value
