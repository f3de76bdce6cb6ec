"""Kills a recorder at random moments and counts what is lost.

``python tests/integration/recorder_kills.py 100`` prints the shares over 100 kills. The child notes the arrival of each
message in a side file before it hands the message over; what is noted and not recovered is lost.
"""

from __future__ import annotations

import os
import random
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from recording_samples import CONFIG, frames

from foottrack_service.recording.reader import open_recording
from foottrack_service.recording.recover import recover
from foottrack_service.recording.writer import RecordingWriter

HZ = 1000
AT_ONCE = 4
BATCH_S = 0.005
_STAMP = struct.Struct("<q")


class Kill(NamedTuple):
    """What one kill cost."""

    after_s: float
    handed_over: int
    recovered: int
    lost_s: float
    """Age, at the kill, of the oldest message that is lost."""
    right: bool
    """What came back is what was handed over first, unchanged."""


def record(path: Path, side: Path) -> None:
    """The child: hand messages over at ``HZ`` until killed."""
    content = frames(4000)
    writer = RecordingWriter(path, CONFIG, time.perf_counter_ns)
    notes = os.open(side, os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0))
    begin, index = time.perf_counter(), 0
    while True:
        while index < (time.perf_counter() - begin) * HZ:
            arrival = time.perf_counter_ns()
            os.write(notes, _STAMP.pack(arrival))
            frame = content[index % len(content)]
            writer.write(frame.topic, frame.payload, arrival, arrival, index)
            index += 1
        time.sleep(BATCH_S)


def kill_some(folder: Path, delays_s: list[float]) -> list[Kill]:
    """Start a recorder for each delay and kill it so long after its first message."""
    children = []
    for index in range(len(delays_s)):
        path, side = folder / f"{index}.mcap", folder / f"{index}.notes"
        child = subprocess.Popen([sys.executable, str(Path(__file__).resolve()), "--record", str(path), str(side)])
        children.append((child, path, side))
    begun: dict[int, float] = {}
    killed: dict[int, int] = {}
    while len(killed) < len(children):
        for index, (child, _, side) in enumerate(children):
            if index in killed:
                continue
            if child.poll() is not None:
                raise RuntimeError(f"the recorder ended by itself: {child.returncode}")
            if index not in begun and side.exists() and side.stat().st_size:
                begun[index] = time.perf_counter()
            if index in begun and time.perf_counter() - begun[index] >= delays_s[index]:
                killed[index] = time.perf_counter_ns()
                child.kill()
                child.wait()
        time.sleep(0.001)
    return [_judge(path, side, killed[i], delays_s[i]) for i, (_, path, side) in enumerate(children)]


def _judge(path: Path, side: Path, killed: int, after_s: float) -> Kill:
    noted = [stamp for (stamp,) in _STAMP.iter_unpack(side.read_bytes()[: side.stat().st_size // 8 * 8])]
    part, out = path.with_name(path.name + ".part"), path.with_name(path.name + ".recovered")
    recover(part, out)
    content = frames(4000)
    got = list(open_recording(out).frames()) if out.exists() else []
    right = all(
        (frame.arrival, frame.topic, frame.payload)
        == (noted[index], content[index % len(content)].topic, content[index % len(content)].payload)
        for index, frame in enumerate(got)
    )
    lost_s = (killed - noted[len(got)]) * 1e-9 if len(got) < len(noted) else 0.0
    return Kill(after_s, len(noted), len(got), lost_s, right)


def _main(count: int, seed: int) -> None:
    rng = random.Random(seed)
    kills: list[Kill] = []
    while len(kills) < count:
        delays = [rng.uniform(0.0, 5.0) for _ in range(min(AT_ONCE, count - len(kills)))]
        with tempfile.TemporaryDirectory() as folder:
            kills += kill_some(Path(folder), delays)
        print(f"{len(kills)} kills", file=sys.stderr)
    lost = sorted(kill.lost_s for kill in kills)
    handed, back = sum(k.handed_over for k in kills), sum(k.recovered for k in kills)
    print(f"{len(kills)} kills after 0 to 5 s, all right: {all(kill.right for kill in kills)}")
    print(f"recovered {back} of {handed} messages ({100 * back / handed:.1f} %)")
    print(f"age of the oldest lost message: median {lost[len(lost) // 2]:.3f} s, most {lost[-1]:.3f} s")


if __name__ == "__main__":
    if sys.argv[1] == "--record":
        record(Path(sys.argv[2]), Path(sys.argv[3]))
    else:
        _main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1)
