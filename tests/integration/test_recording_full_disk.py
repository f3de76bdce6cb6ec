"""A disk that really is full: a small one in memory, where the system lets us mount it."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from recording_samples import BEGIN_NS, CONFIG, frames_of

from foottrack_service.recording.errors import DiskFullError, RecordingError, WriteError
from foottrack_service.recording.recover import recover
from foottrack_service.recording.writer import RecordingWriter

MIB = 1 << 20
WAIT_S = 30.0


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "disk"
    folder.mkdir()
    if not sys.platform.startswith("linux") or os.geteuid() != 0:
        pytest.skip("mounting a small disk needs root on Linux")
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=6m", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip(f"no tmpfs can be mounted here: {mounted.stderr.decode().strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def fill(writer: RecordingWriter, ended: threading.Event) -> list[bytes]:
    """Hand over what does not compress until the recording ends; the payloads that were taken."""
    rng = random.Random(1)
    taken = []
    for index in range(100_000):
        payload = b"\xc5\x27\x10" + rng.randbytes(10_000)
        if writer.write(b"user/raw/camera", payload, BEGIN_NS + index, 0, index):
            taken.append(payload)
        if ended.wait(0.0005):
            return taken
    raise AssertionError("the disk is never full")


def test_before_the_disk_is_full_the_recording_ends_whole(small_disk: Path) -> None:
    ended = threading.Event()
    path = small_disk / "a.mcap"
    writer = RecordingWriter(path, CONFIG, lambda: 0, on_error=lambda _: ended.set(), reserve_bytes=2 * MIB)
    taken = fill(writer, ended)
    writer.close()
    assert isinstance(writer.error, DiskFullError)
    got = [frame.payload for frame in frames_of(path)]
    assert len(got) == writer.stats.written > 100
    assert got == taken[: len(got)]
    assert writer.stats.dropped >= len(taken) - len(got)
    assert [each.name for each in small_disk.iterdir()] == ["a.mcap"]


def test_without_a_reserve_what_was_flushed_can_be_recovered(small_disk: Path, tmp_path: Path) -> None:
    ended = threading.Event()
    errors: list[RecordingError] = []

    def on_error(error: RecordingError) -> None:
        errors.append(error)
        ended.set()

    writer = RecordingWriter(small_disk / "a.mcap", CONFIG, lambda: 0, on_error=on_error, reserve_bytes=0)
    taken = fill(writer, ended)
    assert isinstance(errors[0], WriteError)
    with pytest.raises(WriteError):
        writer.close()
    report = recover(small_disk / "a.mcap.part", tmp_path / "b.mcap")
    got = [frame.payload for frame in frames_of(tmp_path / "b.mcap")]
    assert got == taken[: len(got)]
    assert len(got) > 300
    assert not report.whole
    assert report.has_config
