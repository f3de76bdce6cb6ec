"""Frames for the tests of recordings: several streams, every value different."""

from __future__ import annotations

import random
from pathlib import Path

from foottrack_protocol import Message, encode
from foottrack_protocol import messages as m
from foottrack_service.recording.file import RecordingFile
from foottrack_service.recording.reader import Frame, open_recording

BEGIN_NS = 5_000_000_000_000
STEP_NS = 1_000_000
CONFIG = 'user = "user"\n\n[body]\nheight = 1.81\n'


def message(index: int, rng: random.Random, sid: str = "run1") -> Message:
    """The ``index``-th message: IMUs left and right, the head, a marker, in turn, 1 ms apart."""
    t = BEGIN_NS + index * STEP_NS

    def vector() -> tuple[float, float, float]:
        return (rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0), rng.gauss(0.0, 1.0))

    kind = index % 4
    data: m.Body
    if kind < 2:
        side = ("left", "right")[kind]
        data = m.Imu(acc=vector(), gyro=vector(), t_dev=index, t_arr=t + 500_000, accuracy=3)
        stream, src = f"imu/{side}", f"imu-{side}"
    elif kind == 2:
        data = m.HeadPose(p=vector(), q=(0.0, 0.6, 0.0, 0.8), tracked=True)
        stream, src = "head/pose", "headset"
    else:
        data = m.Optical(p=vector(), cov=(1e-6, 0.0, 0.0, 1e-6, 0.0, 4e-6), edge_px=rng.random(), frame=index)
        stream, src = "marker/left", "camera"
    return Message("user", stream, src, sid, index // 4, t, t + 600_000, True, data)


def frames(count: int, seed: int = 1, sid: str = "run1") -> list[Frame]:
    """``count`` frames in order of arrival."""
    rng = random.Random(seed)
    made = []
    for index in range(count):
        topic, payload = encode(message(index, rng, sid))
        made.append(Frame(BEGIN_NS + index * STEP_NS + 700_000, topic, payload))
    return made


def write(path: Path, content: list[Frame], chunk: int = 10_000, config: str | None = CONFIG) -> Path:
    """A recording of these frames, a chunk every ``chunk`` messages, stamps as the recorder has them."""
    with RecordingFile(path, config) as file:
        for index, frame in enumerate(content):
            file.add(frame.topic, frame.payload, frame.arrival, frame.arrival - 100_000, index // 4)
            if (index + 1) % chunk == 0:
                file.flush()
    return path


def frames_of(path: Path) -> list[Frame]:
    """All frames of a recording."""
    return list(open_recording(path).frames())
