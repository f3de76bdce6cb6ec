"""What is written, seen with the format's own library as a second reader."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import msgpack
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment, Header
from mcap.stream_reader import StreamReader
from recording_samples import BEGIN_NS, CONFIG, frames, frames_of, write

from foottrack_protocol.topics import SYSTEM_TOPICS, TOPICS
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.file import RecordingFile
from foottrack_service.recording.reader import open_recording
from foottrack_service.recording.schemas import channel_schema


def test_the_librarys_reader_gets_every_message_with_its_stamps(tmp_path: Path) -> None:
    sent = frames(200)
    path = write(tmp_path / "a.mcap", sent, chunk=50)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        got = list(reader.iter_messages(log_time_order=False))
        assert reader.get_header().profile == "foottrack"
    assert [(c.topic.encode(), bytes(r.data), r.log_time) for _, c, r in got] == [
        (f.topic, f.payload, f.arrival) for f in sent
    ]
    assert [(r.publish_time, r.sequence) for _, _, r in got] == [
        (f.arrival - 100_000, i // 4) for i, f in enumerate(sent)
    ]
    assert {(c.message_encoding, s.encoding) for s, c, _ in got if s} == {("msgpack", "jsonschema")}


def test_the_settings_are_the_first_thing_in_the_file(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", frames(8))
    with path.open("rb") as stream:
        header, attachment = (record for record, _ in zip(StreamReader(stream).records, range(2), strict=False))
    assert isinstance(header, Header)
    assert isinstance(attachment, Attachment)
    assert (attachment.name, attachment.data.decode()) == ("foottrack.toml", CONFIG)
    assert open_recording(path).config_toml == CONFIG


def test_a_recording_without_settings_says_so(tmp_path: Path) -> None:
    assert open_recording(write(tmp_path / "a.mcap", frames(8), config=None)).config_toml is None


def test_payloads_fit_the_schema_of_their_channel() -> None:
    for frame in frames(8):
        schema = json.loads(channel_schema(frame.topic.decode()).text)
        jsonschema.Draft202012Validator.check_schema(schema)
        jsonschema.validate(msgpack.unpackb(frame.payload), schema)


def test_a_schema_refuses_what_is_no_such_message() -> None:
    schema = json.loads(channel_schema("user/imu/left").text)
    payload = msgpack.unpackb(frames(1)[0].payload)
    payload["data"]["acc"] = "none"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(payload, schema)


@pytest.mark.parametrize("topic", [*(f"user/{name}" for name in TOPICS), *(f"sys/{name}" for name in SYSTEM_TOPICS)])
def test_every_stream_of_the_registry_has_a_schema_of_its_own_name(topic: str) -> None:
    schema = channel_schema(topic)
    jsonschema.Draft202012Validator.check_schema(json.loads(schema.text))
    assert schema.name.startswith("foottrack.")
    assert schema.name != "foottrack.unknown"


def test_an_unknown_topic_is_recorded_all_the_same(tmp_path: Path) -> None:
    with RecordingFile(tmp_path / "a.mcap", None) as file:
        file.add(b"user/raw/imu-left", b"\x80", 7, 0, 0)
    assert [(f.topic, f.payload) for f in frames_of(tmp_path / "a.mcap")] == [(b"user/raw/imu-left", b"\x80")]
    assert list(open_recording(tmp_path / "a.mcap").messages()) == []


def test_the_same_calls_give_the_same_bytes(tmp_path: Path) -> None:
    one = write(tmp_path / "a.mcap", frames(100), chunk=30)
    two = write(tmp_path / "b.mcap", frames(100), chunk=30)
    assert one.read_bytes() == two.read_bytes()


def test_stamps_and_numbers_beyond_mcaps_ranges_do_not_stop_it(tmp_path: Path) -> None:
    with RecordingFile(tmp_path / "a.mcap", None) as file:
        file.add(b"user/imu/left", b"\x80", BEGIN_NS, -5, 2**32 + 3)
    with (tmp_path / "a.mcap").open("rb") as stream:
        _, _, record = next(iter(make_reader(stream).iter_messages()))
    assert (record.publish_time, record.sequence) == (0, 3)


def test_it_has_its_name_only_when_it_is_whole(tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "a.mcap", CONFIG)
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap.part"]
    file.finish()
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.parametrize("taken", ["a.mcap", "a.mcap.part"])
def test_nothing_is_ever_overwritten(tmp_path: Path, taken: str) -> None:
    (tmp_path / taken).write_bytes(b"precious")
    with pytest.raises(RecordingError, match="exists already"):
        RecordingFile(tmp_path / "a.mcap", CONFIG)
    assert (tmp_path / taken).read_bytes() == b"precious"


def test_a_folder_that_is_not_there_is_an_error_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="nowhere"):
        RecordingFile(tmp_path / "nowhere" / "a.mcap", CONFIG)


def test_an_error_inside_leaves_the_part_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(KeyError), RecordingFile(tmp_path / "a.mcap", CONFIG) as file:
        file.add(b"user/imu/left", b"\x80", 1, 1, 0)
        raise KeyError
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap.part"]
