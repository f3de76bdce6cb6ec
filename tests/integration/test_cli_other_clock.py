"""Commands on another host than the service's: what they stamp, and the ages they show, are of the service's clock."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bus_traffic import BODY
from free_ports import three_free_ports
from typer.testing import CliRunner

from foottrack_protocol import Message
from foottrack_service.bus import Broker, Bus, ControlServer, now
from foottrack_service.cli.main import app
from foottrack_service.config import BusSettings
from foottrack_service.recording.reader import open_recording

APART_NS = 5_000_000_000_000
SANE_NS = 60_000_000_000
"""More than any machine is late, and far less than the clocks are apart."""
TIMEOUT_S = 20.0


def service_clock() -> int:
    """Of a host that was up for longer."""
    return now() + APART_NS


class Elsewhere:
    """A service on a host with another clock: control socket, one stream of its own, and all that others publish."""

    def __init__(self) -> None:
        first = f"tcp://127.0.0.1:{three_free_ports()}"
        self.address = first
        self._settings = BusSettings.beginning_at(first)
        self._ready = threading.Event()
        self._heard: list[Message] = []
        self._news = threading.Condition()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)

    def heard(self, user: str, stream: str) -> list[Message]:
        """What somebody published, as soon as there is something."""
        found: list[Message] = []

        def look() -> bool:
            found[:] = [message for message in self._heard if (message.user, message.stream) == (user, stream)]
            return bool(found)

        with self._news:
            assert self._news.wait_for(look, TIMEOUT_S)
        return found

    def __enter__(self) -> Elsewhere:
        self._thread.start()
        assert self._ready.wait(TIMEOUT_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._ending.set)
        self._thread.join(TIMEOUT_S)
        assert not self._thread.is_alive()

    async def _run(self) -> None:
        self._loop, self._ending = asyncio.get_running_loop(), asyncio.Event()
        with Broker(self._settings) as broker:
            server = ControlServer(broker.context, self._settings.control, {}, clock=service_clock)
            with Bus.connect(broker.inproc, broker.context, service_clock) as bus:
                publisher, subscriber = bus.publisher("lighthouse"), bus.subscriber()
                await publisher.ready()
                await subscriber.ready()
                serving = asyncio.ensure_future(server.run())
                self._ready.set()
                while not self._ending.is_set():
                    publisher.publish("user", "truth/left", service_clock(), BODY)
                    with self._news:
                        self._heard += [received.message for received in subscriber.drain()]
                        self._news.notify_all()
                    await asyncio.sleep(0.01)
                server.close()
                await serving


@pytest.fixture
def elsewhere() -> Iterator[Elsewhere]:
    with Elsewhere() as made:
        yield made


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elsewhere: Elsewhere) -> Callable[..., str]:
    """``foottrack`` in a folder of its own, on that bus."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> str:
        done = CliRunner().invoke(app, [*arguments, "--connect", elsewhere.address])
        assert done.exit_code == 0, done.output
        return done.stdout

    return run


def test_top_shows_ages_and_latencies_of_the_services_clock(command: Callable[..., str]) -> None:
    row = json.loads(command("top", "--json", "--seconds", "0.5"))["streams"]["user/truth/left"]
    assert row["hz"] > 0.0
    assert abs(row["latency_ms"]) < SANE_NS * 1e-6
    assert abs(row["age_s"]) < SANE_NS * 1e-9


def test_what_a_simulation_publishes_is_valid_and_on_the_services_clock(
    command: Callable[..., str], elsewhere: Elsewhere
) -> None:
    before = service_clock()
    command("sim", "--task", "still", "--seconds", "1")
    after = service_clock()
    for pose in elsewhere.heard("user", "head/pose"):
        assert pose.valid
        assert before - SANE_NS < pose.t < after + SANE_NS
        assert before - SANE_NS < pose.t_pub < after + SANE_NS


def test_a_recording_has_arrivals_and_a_replay_stamps_of_the_services_clock(
    command: Callable[..., str], elsewhere: Elsewhere, tmp_path: Path
) -> None:
    command("record", "elsewhere.mcap", "--seconds", "0.5")
    recorded = list(open_recording(tmp_path / "elsewhere.mcap").messages())
    assert recorded
    for each in recorded:
        assert abs(each.arrival - each.message.t_pub) < SANE_NS
    before = service_clock()
    command("replay", "elsewhere.mcap", "--user", "ghost")
    for message in elsewhere.heard("ghost", "truth/left"):
        assert before - SANE_NS < message.t < service_clock() + SANE_NS
