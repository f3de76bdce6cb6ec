"""Bare msgpack streams: carried over to the bit, others' read as well, damage named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording_samples import frames, frames_of, write

from foottrack_service.recording.bare import to_bare
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.file import RecordingFile
from foottrack_service.recording.importer import copy
from foottrack_service.recording.reader import Frame, open_recording


def stream(path: Path, *items: bytes) -> Path:
    path.write_bytes(b"".join(items))
    return path


def test_one_map_has_topic_log_time_and_the_envelope() -> None:
    frame = frames(1)[0]
    value = msgpack.unpackb(to_bare(frame))
    assert list(value)[:2] == ["topic", "log_time"]
    assert (value.pop("topic"), value.pop("log_time")) == ("user/imu/left", frame.arrival)
    assert value == msgpack.unpackb(frame.payload)


def test_exported_and_imported_the_recording_is_the_same_to_the_byte(tmp_path: Path) -> None:
    original = open_recording(write(tmp_path / "a.mcap", frames(3000), chunk=500))
    bare = stream(tmp_path / "a.msgpack", *(to_bare(frame) for frame in original.frames()))
    with RecordingFile(tmp_path / "b.mcap", None) as out:
        copy(open_recording(bare).frames(), out)
    assert frames_of(tmp_path / "b.mcap") == list(original.frames())
    again = b"".join(to_bare(frame) for frame in open_recording(tmp_path / "b.mcap").frames())
    assert again == bare.read_bytes()


HEADS = {
    "fixmap": lambda n: bytes([0x80 | n]),
    "map16": lambda n: b"\xde" + n.to_bytes(2, "big"),
    "map32": lambda n: b"\xdf" + n.to_bytes(4, "big"),
}


@pytest.mark.parametrize(
    ("head", "entries"),
    [*(("fixmap", n) for n in range(16)), *(("map16", n) for n in (0, 13, 16, 20)), ("map32", 3), ("map32", 70000)],
)
def test_every_form_of_a_maps_head_comes_back(tmp_path: Path, head: str, entries: int) -> None:
    body = b"".join(msgpack.packb(f"k{n}") + msgpack.packb(n) for n in range(entries))
    frame = Frame(5, b"user/imu/left", HEADS[head](entries) + body)
    assert list(open_recording(stream(tmp_path / "a", to_bare(frame))).frames()) == [frame]


def test_a_payload_with_keys_of_our_names_comes_back(tmp_path: Path) -> None:
    frame = Frame(5, b"user/imu/left", msgpack.packb({"topic": "other", "log_time": "never", "x": 1}))
    assert list(open_recording(stream(tmp_path / "a", to_bare(frame))).frames()) == [frame]


def test_keys_in_another_order_are_read_too(tmp_path: Path) -> None:
    frame = frames(1)[0]
    value = {**msgpack.unpackb(frame.payload), "log_time": 9, "topic": "user/imu/left"}
    (got,) = open_recording(stream(tmp_path / "a", msgpack.packb(value))).frames()
    assert (got.arrival, got.topic) == (9, b"user/imu/left")
    assert msgpack.unpackb(got.payload) == msgpack.unpackb(frame.payload)


def test_a_long_stream_is_read_across_its_blocks(tmp_path: Path) -> None:
    payload = msgpack.packb({"blob": b"x" * 99_991})
    sent = [Frame(n, b"user/raw/camera", payload) for n in range(40)]
    recording = open_recording(stream(tmp_path / "a", *(to_bare(frame) for frame in sent)))
    assert list(recording.frames()) == sent
    assert list(recording.frames(30)) == sent[30:]
    span = recording.span()
    assert span is not None
    assert (span.first, span.last) == (0, 39)
    assert recording.topics() == {b"user/raw/camera"}
    assert recording.config_toml is None


def test_a_torn_stream_says_where(tmp_path: Path) -> None:
    sent = frames(5)
    packed = [to_bare(frame) for frame in sent]
    got = []
    with pytest.raises(RecordingError, match="torn") as caught:
        got.extend(open_recording(stream(tmp_path / "a", *packed[:-1], packed[-1][:-1])).frames())
    assert caught.value.offset == sum(map(len, packed[:-1]))


BAD: list[Any] = [
    {"topic": "user/imu/left"},
    {"log_time": 5, "x": 1},
    {"topic": 5, "log_time": 5},
    {"topic": "user/imu/left", "log_time": 1.5},
    {"topic": "user/imu/left", "log_time": -1},
    {},
]


@pytest.mark.parametrize("value", [*BAD, [1], 7, "topic"])
def test_what_is_no_such_map_is_an_error_at_its_place(tmp_path: Path, value: Any) -> None:
    good = to_bare(frames(1)[0])
    with pytest.raises(RecordingError) as caught:
        frames_of(stream(tmp_path / "a", good, msgpack.packb(value), good))
    assert caught.value.offset == len(good)


@given(tail=st.binary(max_size=60))
def test_any_bytes_give_frames_or_an_error(tmp_path_factory: pytest.TempPathFactory, tail: bytes) -> None:
    path = stream(tmp_path_factory.mktemp("bare") / "a", to_bare(frames(1)[0]), tail)
    try:
        assert len(frames_of(path)) >= 1
    except RecordingError as error:
        assert error.path == path
