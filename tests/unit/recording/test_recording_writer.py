"""The writing thread: nothing lost, nothing waited for, and a proper end when the disk is full."""

from __future__ import annotations

import errno
import itertools
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, cast

import pytest
from recording_samples import CONFIG, frames, frames_of

from foottrack_service.recording.errors import DiskFullError, RecordingError, WriteError
from foottrack_service.recording.reader import Frame
from foottrack_service.recording.recover import recover
from foottrack_service.recording.writer import MESSAGE_OVERHEAD_BYTES, RecordingWriter

WAIT_S = 20.0


class WatchedFile:
    """A file that calls ``before_write`` with the bytes written so far, to hold it up or to refuse."""

    def __init__(self, path: Path, before_write: Callable[[int], None]) -> None:
        self._file = path.open("xb")
        self._before = before_write

    def write(self, data: bytes) -> int:
        self._before(self._file.tell() + len(data))
        return self._file.write(data)

    def __getattr__(self, name: str) -> object:
        return getattr(self._file, name)


def opener(before_write: Callable[[int], None]) -> Callable[[Path], BinaryIO]:
    return lambda path: cast(BinaryIO, WatchedFile(path, before_write))


def hand_over(writer: RecordingWriter, sent: list[Frame]) -> int:
    return sum(writer.write(f.topic, f.payload, f.arrival, f.arrival - 100_000, i // 4) for i, f in enumerate(sent))


def test_everything_handed_over_is_in_the_file(tmp_path: Path) -> None:
    sent = frames(3000)
    writer = RecordingWriter(tmp_path / "a.mcap", CONFIG, lambda: 7)
    assert hand_over(writer, sent) == 3000
    writer.close()
    assert frames_of(tmp_path / "a.mcap") == sent
    assert writer.stats.written == writer.stats.accepted == 3000
    assert writer.stats.dropped == 0
    assert writer.error is None


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nowhere.*a\.mcap: cannot be written: No such file"):
        RecordingWriter(tmp_path / "nowhere" / "a.mcap", CONFIG, lambda: 7)


def wait_until_flushed(part: Path, count: int, scratch: Path) -> Path:
    """The recovered recording, as soon as ``count`` messages are in the file."""
    scratch.mkdir()
    end = time.monotonic() + WAIT_S
    for attempt in itertools.count():
        out = scratch / f"{attempt}.mcap"
        if recover(part, out).messages == count:
            return out
        assert time.monotonic() < end, "not flushed"
        threading.Event().wait(0.02)
    raise AssertionError


def test_what_was_handed_over_reaches_the_file_while_it_is_open(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "a.mcap", CONFIG, lambda: 7)
    sent = frames(40)
    hand_over(writer, sent)
    assert frames_of(wait_until_flushed(tmp_path / "a.mcap.part", 40, tmp_path / "seen")) == sent
    writer.close()


def test_a_disk_that_stands_still_costs_messages_and_never_time(tmp_path: Path) -> None:
    go_on = threading.Event()
    armed = threading.Event()

    def hold(_size: int) -> None:
        if armed.is_set():
            go_on.wait(WAIT_S)

    sent = frames(400)
    room = sum(len(f.payload) + MESSAGE_OVERHEAD_BYTES for f in sent[:100])
    writer = RecordingWriter(tmp_path / "a.mcap", CONFIG, lambda: 7, opener=opener(hold), queue_bytes=room)
    armed.set()
    taken = hand_over(writer, sent)
    go_on.set()
    writer.close()
    assert 100 <= taken < 400
    assert writer.stats.dropped == 400 - taken
    assert writer.stats.written == taken == len(frames_of(tmp_path / "a.mcap"))


def test_a_full_disk_is_noticed_before_it_happens_and_the_recording_is_whole(tmp_path: Path) -> None:
    free = [10_000_000]
    ended = threading.Event()
    errors: list[RecordingError] = []

    def on_error(error: RecordingError) -> None:
        errors.append(error)
        ended.set()

    writer = RecordingWriter(
        tmp_path / "a.mcap",
        CONFIG,
        lambda: 7,
        on_error=on_error,
        free_bytes=lambda _folder: free[0],
        reserve_bytes=1_000_000,
    )
    sent = frames(500)
    hand_over(writer, sent)
    end = time.monotonic() + WAIT_S
    while writer.stats.written < 500:
        assert time.monotonic() < end
        threading.Event().wait(0.005)
    free[0] = 999_999
    assert ended.wait(WAIT_S)
    assert isinstance(writer.error, DiskFullError)
    assert errors == [writer.error]
    assert frames_of(tmp_path / "a.mcap") == sent
    assert not writer.write(b"user/imu/left", b"\x80", 1, 1, 0)
    writer.close()
    assert writer.stats.dropped == 1


def test_it_does_not_begin_on_a_full_disk(tmp_path: Path) -> None:
    with pytest.raises(DiskFullError):
        RecordingWriter(tmp_path / "a.mcap", CONFIG, lambda: 7, free_bytes=lambda _folder: 5)
    assert list(tmp_path.iterdir()) == []


def test_a_system_that_refuses_bytes_leaves_what_can_be_recovered(tmp_path: Path) -> None:
    full = threading.Event()

    def refuse(_size: int) -> None:
        if full.is_set():
            raise OSError(errno.ENOSPC, "No space left on device")

    ended = threading.Event()
    writer = RecordingWriter(
        tmp_path / "a.mcap", CONFIG, lambda: 7, opener=opener(refuse), on_error=lambda _error: ended.set()
    )
    sent = frames(100)
    hand_over(writer, sent[:40])
    wait_until_flushed(tmp_path / "a.mcap.part", 40, tmp_path / "seen")
    full.set()
    hand_over(writer, sent[40:])
    assert ended.wait(WAIT_S)
    with pytest.raises(WriteError, match="No space left"):
        writer.close()
    assert not (tmp_path / "a.mcap").exists()
    report = recover(tmp_path / "a.mcap.part", tmp_path / "b.mcap")
    assert frames_of(tmp_path / "b.mcap") == sent[:40]
    assert not report.whole
