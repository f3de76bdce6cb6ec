"""Recording from and replaying on a live bus."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import pytest
from recording_samples import frames, frames_of, message, write

from foottrack_protocol import Message, decode
from foottrack_protocol import messages as m
from foottrack_protocol.topics import Role
from foottrack_service.bus import Bus, ControlError, ControlServer, ManualClock, Publisher
from foottrack_service.config import Settings, from_toml
from foottrack_service.recording import node
from foottrack_service.recording.errors import RecordingError, ReplayRefusedError
from foottrack_service.recording.live_replay import LiveReplay, Status
from foottrack_service.recording.play import live_topics, play, replayed_topics
from foottrack_service.recording.reader import Frame, open_recording
from foottrack_service.recording.writer import RecordingWriter

Run = Callable[[Coroutine[Any, Any, Any]], Any]
SETTINGS = Settings(user="user")


async def arrived(writer: RecordingWriter, count: int) -> None:
    while writer.stats.accepted < count:  # noqa: ASYNC110 the recorder has no event for it
        await asyncio.sleep(0.001)


def test_what_is_published_is_recorded_to_the_byte(bus: Bus, run: Run, tmp_path: Path) -> None:
    async def scenario() -> list[Frame]:
        started: asyncio.Future[RecordingWriter] = asyncio.get_running_loop().create_future()
        recorder = asyncio.create_task(node.run(bus, SETTINGS, tmp_path / "a.mcap", on_started=started.set_result))
        publisher = bus.publisher("test")
        await publisher.ready()
        writer = await started
        sent = frames(2000)
        for index, frame in enumerate(sent):
            assert publisher.send_frames((frame.topic, frame.payload))
            if index == 1000:
                publisher.publish("user", "camera/preview", 1, m.CameraPreview(jpeg=b"not recorded"))
        await arrived(writer, 2000)
        recorder.cancel()
        with pytest.raises(asyncio.CancelledError):
            await recorder
        assert (writer.stats.written, writer.stats.dropped) == (2000, 0)
        return sent

    sent = run(scenario())
    got = frames_of(tmp_path / "a.mcap")
    assert [(f.topic, f.payload) for f in got] == [(f.topic, f.payload) for f in sent]
    assert [f.arrival for f in got] == sorted(f.arrival for f in got)
    config = open_recording(tmp_path / "a.mcap").config_toml
    assert config is not None
    assert from_toml(config) == SETTINGS


def test_recordings_on_request_go_into_their_folder_and_nowhere_else(
    bus: Bus, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    async def scenario() -> None:
        recorder = node.Recorder(bus, SETTINGS, Path("recordings"))
        server = ControlServer(bus.context, "inproc://control-of-this-test", recorder.handlers)
        serving = asyncio.create_task(server.run())
        settings = bus.settings.model_copy(update={"control": server.endpoint})
        with Bus.connect(settings, bus.context) as other:
            client = other.control()

            async def error_of(cmd: str, **args: Any) -> str:
                with pytest.raises(ControlError) as caught:
                    await client.request(cmd, args)
                return caught.value.code

            for name in ("../walk", "a/b", "", "a.mcap", "a" * 101, "ä"):
                assert await error_of("record/start", name=name) == "bad_arguments"
            assert await error_of("record/stop") == "not_running"
            started = await client.request("record/start", {"name": "walk-1"})
            assert Path(started["file"]) == tmp_path / "recordings" / "walk-1.mcap"
            assert await error_of("record/start", name="walk-2") == "busy"
            result = await client.request("record/stop")
            assert (result["file"], result["dropped"]) == (started["file"], 0)
            assert await error_of("record/start", name="walk-1") == "exists"
            await client.request("record/start", {"name": "walk-2"})
            await client.request("record/stop")
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        server.close()

    run(scenario())
    made = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*"))
    assert made == ["recordings", "recordings/walk-1.mcap", "recordings/walk-2.mcap"]


def test_a_folder_that_cannot_be_made_is_the_answer(bus: Bus, run: Run, tmp_path: Path) -> None:
    (tmp_path / "recordings").write_text("a file")
    recorder = node.Recorder(bus, SETTINGS, tmp_path / "recordings")

    async def scenario() -> None:
        with pytest.raises(ControlError, match="recordings") as caught:
            await recorder.start("walk")
        assert caught.value.code == "failed"
        assert not recorder.recording

    run(scenario())


class Stage:
    """A live replay on a clock that stands still until it is stepped."""

    def __init__(self, path: Path, content: list[Frame], **options: Any) -> None:
        self.clock = ManualClock(10**15)
        self.sent: list[Message] = []
        recording = open_recording(write(path / "a.mcap", content, chunk=10))
        self.replay = LiveReplay(recording, self.sent.append, self.clock, **options)
        self.task = asyncio.create_task(self.replay.run())

    async def step(self, ms: float) -> int:
        """Step the clock, wake the replay, and say how many messages it has published."""
        self.clock.advance(round(ms * 1e6))
        self.replay.set_rate(self.replay.status.rate)
        for _ in range(50):
            await asyncio.sleep(0)
        return len(self.sent)

    async def play(self, ms: float) -> None:
        """Step on in small steps, as a real clock does, until it has ended or ``ms`` are over."""
        for _ in range(round(ms / 10)):
            await self.step(10)
            if self.task.done():
                return


def test_a_replay_keeps_pace_and_moves_the_stamps_to_now(run: Run, tmp_path: Path) -> None:
    content = frames(100)

    async def scenario() -> Stage:
        stage = Stage(tmp_path, content)
        assert await stage.step(0) == 1
        assert await stage.step(10) == 11
        assert await stage.step(0.5) == 11
        assert await stage.step(0.5) == 12
        await stage.play(200)
        await stage.task
        return stage

    stage = run(scenario())
    moved = 10**15 - content[0].arrival
    originals = [decode((frame.topic, frame.payload)) for frame in content]
    assert [s.t - o.t for s, o in zip(stage.sent, originals, strict=True)] == [moved] * 100
    assert [s._replace(sid="", t=0, t_pub=0, data=None) for s in stage.sent] == [
        o._replace(sid="", t=0, t_pub=0, data=None) for o in originals
    ]
    for sent, original in zip(stage.sent, originals, strict=True):
        if isinstance(original.data, m.Imu):
            assert sent.data == original.data.model_copy(update={"t_arr": original.data.t_arr + moved})
        else:
            assert sent.data == original.data
    assert len({s.sid for s in stage.sent}) == 1
    assert stage.sent[0].sid != originals[0].sid
    assert all(s.t <= s.t_pub for s in stage.sent)


def test_pause_seek_rate(run: Run, tmp_path: Path) -> None:
    async def scenario() -> Stage:
        stage = Stage(tmp_path, frames(1000))
        assert await stage.step(10) == 11
        stage.replay.pause()
        assert await stage.step(500) == 11
        assert stage.replay.status.paused
        stage.replay.resume()
        assert await stage.step(10) == 21
        answer = stage.replay.seek(0.5)
        assert answer["position"] == pytest.approx(0.5)
        await stage.step(0)
        assert stage.sent[-1].data.acc == decode(frames(1000)[500][1:]).data.acc
        assert (stage.sent[-1].seq, stage.sent[-1].sid != stage.sent[0].sid) == (0, True)
        stage.replay.set_rate(10.0)
        before = len(stage.sent)
        assert await stage.step(10) == before + 100
        with pytest.raises(ControlError, match="rate"):
            stage.replay.set_rate(0.0)
        with pytest.raises(ControlError):
            stage.replay.seek(float("nan"))
        stage.replay.seek(99.0)
        await stage.step(0)
        await stage.task
        return stage

    stage = run(scenario())
    stamps = [s.t for s in stage.sent if s.stream == "imu/left"]
    assert stamps == sorted(stamps)


def test_keys(run: Run, tmp_path: Path) -> None:
    async def scenario() -> None:
        stage = Stage(tmp_path, frames(1000))
        await stage.step(100)
        replay = stage.replay
        assert replay.on_key(" ")
        assert replay.status.paused
        assert replay.on_key(" ")
        assert not replay.status.paused
        replay.on_key("+")
        assert replay.status.rate == 2.0
        for _ in range(20):
            replay.on_key("-")
        assert replay.status.rate == pytest.approx(0.01)
        replay.on_key("right")
        assert replay.status.position == pytest.approx(0.999)
        replay.on_key("left")
        assert replay.status.position == pytest.approx(0.0)
        assert replay.on_key("x")
        assert not replay.on_key("q")
        stage.task.cancel()

    run(scenario())


def test_a_loop_begins_again_as_a_new_run(run: Run, tmp_path: Path) -> None:
    async def scenario() -> Stage:
        stage = Stage(tmp_path, frames(20), loop=True)
        await stage.play(100)
        assert not stage.task.done()
        stage.task.cancel()
        return stage

    sent = run(scenario()).sent
    assert len(sent) >= 60
    assert len({s.sid for s in sent}) >= 3
    assert sent[20].seq == 0
    assert sent[20].t > sent[16].t


def test_a_loop_without_a_wanted_message_ends(run: Run, tmp_path: Path) -> None:
    async def scenario() -> int:
        stage = Stage(tmp_path, frames(20), loop=True, roles=(Role.RESULT,))
        await stage.task
        return len(stage.sent)

    assert run(scenario()) == 0


def test_roles_and_user(run: Run, tmp_path: Path) -> None:
    session = Message("sys", "log", "x", "s", 0, 1, 1, True, m.LogRecord(level="error", logger="a", message="b"))
    truth = Message("user", "truth/left", "x", "s", 0, 1, 1, True, m.Truth(p=(0.0,) * 3, q=(0.0, 0.0, 0.0, 1.0)))

    async def scenario() -> list[Message]:
        from foottrack_protocol import encode

        content = [frames(1)[0], *(Frame(frames(1)[0].arrival, *encode(each)) for each in (session, truth))]
        stage = Stage(tmp_path, content, user="other", roles=(Role.MEASUREMENT,))
        await stage.task
        return stage.sent

    assert [s.topic for s in run(scenario())] == ["other/imu/left"]


def test_an_empty_recording_cannot_be_played(run: Run, tmp_path: Path) -> None:
    async def scenario() -> None:
        with pytest.raises(RecordingError, match="no message"):
            Stage(tmp_path, [])

    run(scenario())


async def _speak(publisher: Publisher) -> None:
    import random

    while True:
        publisher.send(message(0, random.Random(1)))
        await asyncio.sleep(0.01)


def test_it_does_not_speak_over_a_live_publisher_unless_as_another_user(bus: Bus, run: Run, tmp_path: Path) -> None:
    recording = open_recording(write(tmp_path / "a.mcap", frames(100)))

    async def scenario() -> tuple[Status, list[Message]]:
        publisher = bus.publisher("imu-left")
        await publisher.ready()
        speaking = asyncio.create_task(_speak(publisher))
        assert await live_topics(bus, {"user"}, 0.3) == {"user/imu/left"}
        with pytest.raises(ReplayRefusedError, match="user/imu/left") as caught:
            await play(bus, recording, listen_s=0.3)
        assert caught.value.topics == ["user/imu/left"]
        listener = bus.subscriber(["other/"])
        await listener.ready()
        status = await play(bus, recording, user="other", listen_s=0.3)
        got: list[Message] = []
        async for received in listener:
            got.append(received.message)
            if len(got) == 100:
                break
        speaking.cancel()
        return status, got

    status, got = run(scenario())
    assert (status.published, status.duration) == (100, pytest.approx(0.099))
    assert [g.data for g in got if not isinstance(g.data, m.Imu)] == [
        r.message.data for r in recording.messages() if not isinstance(r.message.data, m.Imu)
    ]
    assert {g.user for g in got} == {"other"}


def test_the_topics_of_a_replay(tmp_path: Path) -> None:
    recording = open_recording(write(tmp_path / "a.mcap", frames(8)))
    assert replayed_topics(recording, None) == {
        "user/imu/left",
        "user/imu/right",
        "user/head/pose",
        "user/marker/left",
    }
    assert replayed_topics(recording, "b", (Role.RESULT,)) == set()
