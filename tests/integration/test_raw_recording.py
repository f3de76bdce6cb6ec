"""From a device or a camera through a raw recording to a desk, where it gives the same again."""

from __future__ import annotations

import asyncio
import socket
import sys
from asyncio.subprocess import PIPE
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from worn_imus import Datagrams, Wearer, stopped

from foottrack_protocol import Message
from foottrack_protocol import messages as m
from foottrack_service.bus import Bus, Publisher
from foottrack_service.camera import node as camera_node
from foottrack_service.camera.process import SOURCE, Watcher
from foottrack_service.camera.setup import Trackers, open_source
from foottrack_service.cli.log_raw import playing, unpack
from foottrack_service.cli.running import CommandFailed
from foottrack_service.config import CameraSettings, Settings, load
from foottrack_service.imu import node as imu_node
from foottrack_service.imu.again import decode_again
from foottrack_service.imu.devices.slimevr import SlimeVrDevice
from foottrack_service.recording import node
from foottrack_service.recording.raw_files import CAMERA, raw_messages, write_raw
from foottrack_service.recording.reader import open_recording
from foottrack_service.recording.writer import RecordingWriter

Run = Callable[[Any], Any]
RAW_LEFT = m.RawImu(bytes=b"\x01\x02", format="rvc", source="COM3", connection=1)


@asynccontextmanager
async def recording(bus: Bus, settings: Settings, path: Path, raw: bool = True) -> AsyncIterator[RecordingWriter]:
    """A recorder that runs; afterwards its file is closed."""
    started: asyncio.Future[RecordingWriter] = asyncio.get_running_loop().create_future()
    recorder = asyncio.create_task(node.run(bus, settings, path, raw=raw, on_started=started.set_result))
    yield await started
    await stopped(recorder)


async def until(condition: Callable[[], bool]) -> None:
    while not condition():  # noqa: ASYNC110 what is waited for has no event
        await asyncio.sleep(0.005)


def of(path: Path, stream: str) -> list[Message]:
    found = [each.message for each in open_recording(path).messages()]
    return [message for message in found if message.stream == stream]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no ptys")
@pytest.mark.parametrize("name", ["ascii", "rvc", "bno08x", "raw"])
def test_recorded_bytes_decode_to_the_samples_that_were_published(
    name: str, tmp_path: Path, bus: Bus, run: Run
) -> None:
    path = tmp_path / "raw.mcap"
    settings = Settings(imu={"left": {"format": name, "port": str(tmp_path / "left"), "delay": 0.002, "rate": 200}})

    async def scenario() -> None:
        async with recording(bus, settings, path) as writer:
            wearer = Wearer(tmp_path / "left", name)
            node_task = asyncio.create_task(imu_node.run(bus, settings))
            wearing = asyncio.create_task(wearer.run())
            wearer.plug()
            await until(lambda: writer.stats.written > 150)
            wearer.unplug()
            await until(lambda: bus.health.body().nodes["imu-left"].state == "restarting")
            before = writer.stats.written
            wearer.plug()
            await until(lambda: writer.stats.written > before + 150)
            await stopped(node_task, wearing)
            wearer.unplug()

    run(scenario())
    raw, samples = of(path, "raw/imu/left"), of(path, "imu/left")
    assert {message.data.connection for message in raw} == {1, 2}
    assert {(message.data.format, message.src) for message in raw} == {(name, "imu-left")}
    decoded = decode_again(raw, settings.imu.left)
    assert len(samples) > 60
    again, published = [(each.t, each.imu) for each in decoded.samples], [(each.t, each.data) for each in samples]
    # The recording may end between the bytes of one read and the samples in them.
    both = min(len(again), len(published))
    assert max(len(again), len(published)) - both <= 8
    assert again[:both] == published[:both]


def test_datagrams_of_a_tracker_decode_at_a_desk_though_it_shook_hands_long_before(
    tmp_path: Path, bus: Bus, run: Run
) -> None:
    path = tmp_path / "raw.mcap"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    mac = "A0:00:00:00:00:01"
    settings = Settings(
        imu={"slimevr_host": "127.0.0.1", "slimevr_port": port, "left": {"format": "slimevr", "port": mac}}
    )

    async def scenario() -> None:
        service = asyncio.create_task(imu_node.run(bus, settings))
        await until(lambda: "imu-left" in bus.health.body().nodes)
        transport, tracker = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: Datagrams(SlimeVrDevice(mac)), remote_addr=("127.0.0.1", port)
        )
        worn = asyncio.create_task(tracker.run())
        await until(lambda: bus.health.body().nodes["imu-left"].state == "running")
        async with recording(bus, settings, path) as writer:
            await until(lambda: writer.stats.written > 150)
            await stopped(worn, service)
            transport.close()

    run(scenario())
    raw, samples = of(path, "raw/imu/left"), of(path, "imu/left")
    assert {message.data.tracker for message in raw} == {f"{mac}/0"}
    decoded = [each.imu for each in decode_again(raw, settings.imu.left).samples]
    assert len(decoded) > 40
    published = [message.data for message in samples]
    # The recorder's subscription reached the node between two samples, maybe between the two packets of one, and the
    # recording may end between the bytes of one read and the samples in them.
    whole = decoded[:-8]
    first = published.index(whole[0])
    assert published[first : first + len(whole)] == whole


def test_pictures_are_found_the_same_at_a_desk(tmp_path: Path, bus: Bus, run: Run) -> None:
    path = tmp_path / "raw.mcap"
    source = {"kind": "rendered", "rendered": {"task": "still", "seed": 3, "seconds": 20.0, "fps": 30.0}}
    settings = Settings(camera=CameraSettings.model_validate({"source": source}))

    async def scenario() -> None:
        camera = asyncio.create_task(camera_node.run(bus, settings))
        await bus.health.wait_running(SOURCE)
        async with recording(bus, settings, path):
            wanted = bus.subscriber(["user/raw/"])
            seen: Counter[int] = Counter()
            async for received in wanted:
                seen[received.message.data.frame] += 1
                if len(seen) > 5:
                    break
            await stopped(camera)

    run(scenario())
    assert max(len(frame.payload) for frame in open_recording(path).frames()) < 256 * 1024
    files = write_raw(open_recording(path), "user", tmp_path / "desk")
    assert files.pictures == files.depths >= 5
    assert files.other_lens == 0
    replayed = open_source(playing(settings, files, tmp_path / "desk" / CAMERA), None)
    watcher = Watcher(Trackers(settings.camera, replayed.intrinsics), False, lambda: 0)
    live = {(each.stream, each.data.frame): each.data for each in _markers(path)}
    numbers = {message.t: message.data.frame for message in raw_messages(open_recording(path))}
    compared = 0
    for _ in range(files.pictures):
        frame = replayed.read()
        for stream, _, body in watcher.report(frame).fixes:
            fix = live.get((stream, numbers[frame.t]))
            if fix is not None and stream.startswith("marker/"):
                # The tags are looked for in the whole picture here, in a window round the last ones there.
                assert body.p == pytest.approx(fix.p, abs=2e-3)
                compared += 1
    assert compared >= 6
    unpack(open_recording(path), tmp_path / "again", None, None, as_json=True)
    assert load(tmp_path / "again" / "foottrack.toml").settings.camera.source.kind == "folder"


def _markers(path: Path) -> list[Message]:
    return of(path, "marker/left") + of(path, "marker/right")


def test_raw_streams_are_wanted_only_while_somebody_names_them(bus: Bus, run: Run) -> None:
    async def scenario() -> None:
        publisher = bus.publisher("imu-left")
        await publisher.ready()
        everything = bus.subscriber(["", "user/"])
        await everything.ready()
        assert not publisher.wanted("user", "raw/imu/left")
        asking, also = bus.subscriber(["user/raw/imu/"]), bus.subscriber(["user/raw/imu/"])
        await asyncio.gather(asking.ready(), also.ready())
        await until(lambda: publisher.wanted("user", "raw/imu/left"))
        assert not publisher.wanted("user", "raw/camera")
        assert not publisher.wanted("other", "raw/imu/left")
        late = bus.publisher("imu-right")
        await until(lambda: late.wanted("user", "raw/imu/right"))
        asking.close()
        also.subscribe("user/raw/camera")
        await until(lambda: publisher.wanted("user", "raw/camera"))
        assert publisher.wanted("user", "raw/imu/left")
        also.close()
        await until(lambda: not publisher.wanted("user", "raw/imu/left"))
        assert not late.wanted("user", "raw/camera")

    run(scenario())


ASK = """
import sys, zmq
socket = zmq.Context().socket(zmq.SUB)
socket.subscribe("user/raw/")
socket.connect(sys.argv[1])
print("connected", flush=True)
sys.stdin.read()
"""


def test_who_is_killed_asks_no_more(bus: Bus, run: Run) -> None:
    async def scenario() -> None:
        publisher = bus.publisher("camera")
        await publisher.ready()
        asking = await asyncio.create_subprocess_exec(sys.executable, "-c", ASK, bus.settings.egress, stdin=PIPE)
        await until(lambda: publisher.wanted("user", "raw/camera"))
        asking.kill()
        await asking.wait()
        await until(lambda: not publisher.wanted("user", "raw/camera"))

    run(scenario())


def _speak(publisher: Publisher, user: str, count: int) -> None:
    for number in range(count):
        publisher.publish(user, "truth/left", number, m.Truth(p=(0.0, 0.0, 0.0), q=(0.0, 0.0, 0.0, 1.0)))
        if publisher.wanted(user, "raw/imu/left"):
            publisher.publish(user, "raw/imu/left", number, RAW_LEFT)


def test_all_users_are_asked_and_other_recordings_are_not_disturbed(bus: Bus, run: Run, tmp_path: Path) -> None:
    plain, whole = tmp_path / "plain.mcap", tmp_path / "raw.mcap"

    async def scenario() -> None:
        one, other = bus.publisher("one"), bus.publisher("other")
        await asyncio.gather(one.ready(), other.ready())
        async with recording(bus, Settings(), plain, raw=False) as without:
            _speak(one, "user", 50)
            _speak(other, "guest-2", 50)
            await until(lambda: without.stats.accepted == 100)
            async with recording(bus, Settings(), whole) as with_raw:
                # A user that the recorder's settings do not know is asked when he is first heard.
                _speak(other, "guest-2", 1)
                await until(lambda: one.wanted("user", "raw/imu/left") and other.wanted("guest-2", "raw/imu/left"))
                _speak(one, "user", 50)
                _speak(other, "guest-2", 50)
                await until(lambda: with_raw.stats.accepted == 201)
            await until(lambda: not other.wanted("guest-2", "raw/imu/left"))
            await until(lambda: without.stats.accepted == 201)

    run(scenario())
    assert Counter(message.topic for message in _all(plain)) == {"user/truth/left": 100, "guest-2/truth/left": 101}
    assert Counter(message.topic for message in _all(whole)) == {
        "user/truth/left": 50,
        "user/raw/imu/left": 50,
        "guest-2/truth/left": 51,
        "guest-2/raw/imu/left": 50,
    }
    assert {message.data for message in raw_messages(open_recording(whole))} == {RAW_LEFT}
    with pytest.raises(CommandFailed, match="guest-2, user"):
        unpack(open_recording(whole), tmp_path / "desk", None, None, as_json=False)
    with pytest.raises(CommandFailed, match="--raw"):
        unpack(open_recording(plain), tmp_path / "desk", None, None, as_json=False)
    unpack(open_recording(whole), tmp_path / "desk", "user", None, as_json=False)
    assert (tmp_path / "desk" / "imu-left.bin").read_bytes() == RAW_LEFT.bytes * 50
    rows = (tmp_path / "desk" / "imu-left.csv").read_text(encoding="utf-8").splitlines()
    assert rows[:2] == ["t_ns,bytes,connection,format,source,tracker", "0,2,1,rvc,COM3,"]
    assert len(rows) == 51


def _all(path: Path) -> list[Message]:
    return [each.message for each in open_recording(path).messages()]
