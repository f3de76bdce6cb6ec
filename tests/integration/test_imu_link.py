"""Serial links over ptys: bytes both ways, unplugging and replugging, both ways to wait for bytes."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from foottrack_service.bus.clock import now
from foottrack_service.imu import ports
from foottrack_service.imu.devices.pty_port import PtyPort
from foottrack_service.imu.line import Line, OnData, OnLost, open_asynchronous, open_threaded
from foottrack_service.imu.link import SerialLink

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")

OPENERS = [open_asynchronous, open_threaded]
Opener = Callable[[str, int, OnData, OnLost, Any], Awaitable[Line]]


class Host:
    """A link with what it heard."""

    def __init__(self, port: Path, opener: Opener) -> None:
        self.heard = bytearray()
        self.arrivals: list[int] = []
        self.opened = 0
        self.due: list[bytes] = []
        self.link = SerialLink(
            "test", lambda: str(port), 115_200, self._on_open, self._on_data, self._to_send, now, open_=opener
        )

    def _on_open(self) -> None:
        self.opened += 1

    def _on_data(self, data: bytes, t_arr: int) -> None:
        self.heard += data
        self.arrivals.append(t_arr)

    def _to_send(self, now_s: float) -> list[bytes]:
        due, self.due = self.due, []
        return due


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(10.0):
        # The other end is a file, which tells nobody.
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.002)


def plug(link: Path, pty: PtyPort) -> None:
    fresh = link.with_suffix(".new")
    fresh.symlink_to(pty.port)
    fresh.replace(link)


@pytest.mark.parametrize("opener", OPENERS)
def test_bytes_go_both_ways(opener: Opener, tmp_path: Path, run: Any) -> None:
    async def scenario() -> None:
        with PtyPort() as device:
            plug(tmp_path / "imu", device)
            host = Host(tmp_path / "imu", opener)
            host.due.append(b"\x7ehello\x00")
            before = now()
            running = asyncio.create_task(host.link.run())
            heard_by_device = bytearray()

            def device_heard() -> bool:
                heard_by_device.extend(device.read())
                return bytes(heard_by_device) == b"\x7ehello\x00"

            await until(device_heard)
            assert host.link.failure is None
            # Bytes that a line discipline would change.
            everything = bytes(range(256)) * 4
            assert device.write(everything) == len(everything)
            await until(lambda: len(host.heard) == len(everything))
            assert bytes(host.heard) == everything
            assert all(before < t_arr <= now() for t_arr in host.arrivals)
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    run(scenario())
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("serial ")]


@pytest.mark.parametrize("opener", OPENERS)
def test_unplugged_and_replugged(opener: Opener, tmp_path: Path, run: Any) -> None:
    async def scenario() -> None:
        host = Host(tmp_path / "imu", opener)
        running = asyncio.create_task(host.link.run())
        # Nothing is plugged in yet.
        await until(lambda: "imu" in (host.link.failure or ""))
        for turn in range(1, 4):
            device = PtyPort()
            plug(tmp_path / "imu", device)
            await until(lambda turn=turn: host.link.connections == turn)  # type: ignore[misc]
            device.write(b"turn %d" % turn)
            await until(lambda turn=turn: host.heard.endswith(b"turn %d" % turn))  # type: ignore[misc]
            device.close()
            await until(lambda turn=turn: host.link.losses == turn)  # type: ignore[misc]
            assert host.link.failure is not None
            assert "gone" in host.link.failure
            assert host.link.port is None
        assert host.opened >= 3
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    run(scenario())


class SilentLine:
    """An adapter that vanishes without an error, as some do."""

    closed = False

    def write(self, data: bytes) -> None:
        pass

    async def close(self) -> None:
        SilentLine.closed = True


def test_an_adapter_that_vanishes_without_an_error_is_noticed(tmp_path: Path, run: Any) -> None:
    async def open_silent(port: str, baud: int, on_data: OnData, on_lost: OnLost, clock: Any) -> Line:
        return SilentLine()

    async def scenario() -> None:
        port = tmp_path / "ttyUSB0"
        port.touch()
        host = Host(port, open_silent)
        running = asyncio.create_task(host.link.run())
        await until(lambda: host.link.connections == 1)
        port.unlink()
        await until(lambda: host.link.losses == 1)
        assert SilentLine.closed
        assert host.link.failure == f"{port} is gone: unplugged"
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    run(scenario())


def test_a_machine_that_cannot_list_its_ports_loses_no_line_and_no_ctrl_c(
    tmp_path: Path, run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[SilentLine] = []

    class Counted(SilentLine):
        def __init__(self) -> None:
            lines.append(self)
            self.open = True

        async def close(self) -> None:
            self.open = False

    async def open_counted(port: str, baud: int, on_data: OnData, on_lost: OnLost, clock: Any) -> Line:
        return Counted()

    def fail(port: str) -> bool:
        raise OSError("the registry is busy")

    async def scenario() -> None:
        host = Host(tmp_path / "ttyUSB0", open_counted)
        monkeypatch.setattr(ports, "exists", fail)
        running = asyncio.create_task(host.link.run())
        await until(lambda: host.link.losses == 1)
        assert host.link.failure == f"{tmp_path / 'ttyUSB0'} is gone: the registry is busy"
        monkeypatch.setattr(ports, "exists", lambda port: True)
        await until(lambda: host.link.connections == 2)
        running.cancel()
        await asyncio.wait({running}, timeout=5.0)
        assert running.cancelled()
        assert not any(line.open for line in lines)

    run(scenario())


def test_a_device_that_wants_pauses_gets_one_byte_at_a_time(tmp_path: Path, run: Any) -> None:
    writes: list[bytes] = []

    class Recorder(SilentLine):
        def write(self, data: bytes) -> None:
            writes.append(data)

    async def open_recorder(port: str, baud: int, on_data: OnData, on_lost: OnLost, clock: Any) -> Line:
        return Recorder()

    async def scenario() -> None:
        port = tmp_path / "ttyUSB0"
        port.touch()
        due = [b"abc"]
        link = SerialLink(
            "test",
            lambda: str(port),
            3_000_000,
            lambda: None,
            lambda data, t: None,
            lambda now_s: [due.pop()] if due else [],
            now,
            byte_gap_s=1e-4,
            open_=open_recorder,
        )
        running = asyncio.create_task(link.run())
        await until(lambda: len(writes) == 3)
        assert writes == [b"a", b"b", b"c"]
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    run(scenario())


@pytest.mark.parametrize("opener", OPENERS)
def test_a_port_that_is_none_says_so(opener: Opener, tmp_path: Path, run: Any) -> None:
    async def scenario() -> None:
        not_a_port = tmp_path / "file"
        not_a_port.write_text("no port")
        with pytest.raises(OSError, match="file"):
            await opener(str(not_a_port), 115_200, lambda data, t: None, lambda reason: None, now)

    run(scenario())
