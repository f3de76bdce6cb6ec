"""What ``log info`` says, on recordings whose figures are known."""

from __future__ import annotations

from pathlib import Path

import pytest
from recording_samples import BEGIN_NS, frames, write

from foottrack_protocol import Message, encode
from foottrack_protocol import messages as m
from foottrack_service.recording.info import RecordingInfo
from foottrack_service.recording.reader import Frame, open_recording


def info(path: Path, content: list[Frame], config: str | None = "") -> RecordingInfo:
    return open_recording(write(path / "a.mcap", content, config=config)).info


def frame(stream: str, data: m.Body, arrival: int, user: str = "user", seq: int = 0, valid: bool = True) -> Frame:
    topic, payload = encode(Message(user, stream, "source", "run", seq, arrival, arrival, valid, data))
    return Frame(arrival, topic, payload)


def test_counts_rates_and_duration(tmp_path: Path) -> None:
    found = info(tmp_path, frames(401))
    left = found.topics["user/imu/left"]
    assert found.messages == 401
    assert found.duration_s == pytest.approx(0.4)
    assert left.messages == 101
    assert left.hz == pytest.approx(250.0)
    assert left.longest_gap_s == pytest.approx(0.004)
    assert left.sources == ["imu-left"]
    assert (left.lost, left.invalid, left.undecodable) == (0, 0, {})
    assert set(found.topics) == {"user/imu/left", "user/imu/right", "user/head/pose", "user/marker/left"}
    assert found.payload_bytes == sum(len(f.payload) for f in frames(401))


def test_missing_messages_are_counted_by_seq(tmp_path: Path) -> None:
    sent = frames(400)
    del sent[40:80]
    found = info(tmp_path, sent)
    assert {name: entry.lost for name, entry in found.topics.items()} == dict.fromkeys(found.topics, 10)
    assert found.topics["user/imu/left"].longest_gap_s == pytest.approx(0.044)


def test_a_publisher_that_began_anew_lost_nothing(tmp_path: Path) -> None:
    again = [f._replace(arrival=f.arrival + 10**9) for f in frames(40, sid="run2")]
    assert sum(entry.lost for entry in info(tmp_path, frames(40) + again).topics.values()) == 0


def test_invalid_and_undecodable_messages_are_counted(tmp_path: Path) -> None:
    head = m.HeadPose(tracked=False)
    content = [frame("head/pose", head, 1, valid=False), frame("head/pose", head, 2, seq=1)]
    content.append(Frame(3, b"user/head/pose", b"\xc1"))
    entry = info(tmp_path, content).topics["user/head/pose"]
    assert (entry.messages, entry.invalid, entry.undecodable) == (3, 1, {"msgpack": 1})


def test_the_last_calibration_of_each_kind_is_shown(tmp_path: Path) -> None:
    floors = [m.FloorCalibration(values=m.FloorValues(height=h)) for h in (0.1, 0.2)]
    imu = m.ImuCalibration(
        values=m.ImuValues(side="left", acc_bias=(0.0,) * 3, gyro_bias=(0.1,) * 3, p=(0.0,) * 3, q=(0.0, 0.0, 0.0, 1.0))
    )
    content = [frame("calibration", c, n, seq=n) for n, c in enumerate([*floors, imu])]
    found = info(tmp_path, content).calibration
    assert found["user/floor"] == {"height": 0.2}
    assert found["user/imu/left"]["gyro_bias"] == [0.1, 0.1, 0.1]


def test_the_session_tells_when_it_was(tmp_path: Path) -> None:
    session = m.Session(
        session="s",
        protocol=m.ProtocolVersion(major=1, minor=0),
        clock=m.ClockAnchor(bus=BEGIN_NS + 50, unix=1_700_000_000_000_000_000),
        users=["user"],
        config_hash="",
    )
    first = frames(1)
    content = [*first, frame("session", session, first[0].arrival + 60, user="sys")]
    assert info(tmp_path, content).begun_unix_ns == 1_700_000_000_000_000_000 - 50 + 700_000


def test_an_empty_recording_has_no_rates(tmp_path: Path) -> None:
    found = info(tmp_path, [], config=None)
    assert (found.messages, found.duration_s, found.begun_unix_ns, found.has_config) == (0, 0.0, None, False)


def test_a_single_message_has_no_rate(tmp_path: Path) -> None:
    assert info(tmp_path, frames(1)).topics["user/imu/left"].hz is None
