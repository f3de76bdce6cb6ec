"""Reading: damage is an error with its place, and never silently wrong data."""

from __future__ import annotations

import io
import random
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer
from recording_samples import BEGIN_NS, frames, frames_of, write

from foottrack_protocol import Message
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.reader import Frame, open_recording, read


def flip(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


def read_until_error(path: Path) -> tuple[list[Frame], RecordingError | None]:
    got: list[Frame] = []
    try:
        got.extend(open_recording(path).frames())
    except RecordingError as error:
        return got, error
    return got, None


def test_messages_come_back_decoded_in_order(tmp_path: Path) -> None:
    sent = frames(50)
    got = list(read(write(tmp_path / "a.mcap", sent, chunk=12)))
    assert [(r.arrival, r.topic, r.payload) for r in got] == sent
    assert all(isinstance(r.message, Message) and r.message.topic.encode() == r.topic for r in got)
    assert got[0].message.t == BEGIN_NS


def test_arrivals_that_go_back_stay_in_file_order(tmp_path: Path) -> None:
    sent = frames(40)
    sent[10], sent[30] = sent[30], sent[10]
    assert frames_of(write(tmp_path / "a.mcap", sent, chunk=8)) == sent


@pytest.mark.parametrize("seed", range(4))
def test_every_flipped_bit_is_an_error_with_its_place(tmp_path: Path, seed: int) -> None:
    sent = frames(80)
    whole = write(tmp_path / "whole.mcap", sent, chunk=20).read_bytes()
    rng = random.Random(seed)
    path = tmp_path / "a.mcap"
    for bit in rng.sample(range(len(whole) * 8), 150):
        path.write_bytes(flip(whole, bit))
        got, error = read_until_error(path)
        assert error is not None, f"bit {bit} of {len(whole) * 8}: not noticed"
        assert error.offset is not None
        assert error.offset <= len(whole)
        assert got == sent[: len(got)], f"bit {bit}: wrong data before the error"


def test_flips_in_the_settings_are_noticed_when_they_are_asked_for(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap", frames(8)).read_bytes()
    begin = whole.index(b"height")
    path = tmp_path / "a.mcap"
    for byte in range(begin, begin + 13):
        path.write_bytes(flip(whole, byte * 8 + 1))
        with pytest.raises(RecordingError, match="checksum"):
            _ = open_recording(path).config_toml


@pytest.mark.parametrize("cut", [1, 8, 9, 20, 300])
def test_a_torn_file_is_an_error_and_its_beginning_is_right(tmp_path: Path, cut: int) -> None:
    sent = frames(80)
    path = write(tmp_path / "a.mcap", sent, chunk=20)
    path.write_bytes(path.read_bytes()[:-cut])
    got, error = read_until_error(path)
    assert error is not None
    assert got == sent[: len(got)]


def test_bytes_after_the_end_are_an_error(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", frames(8))
    path.write_bytes(path.read_bytes() + b"x")
    with pytest.raises(RecordingError):
        frames_of(path)


def test_a_chunk_that_would_unpack_to_all_memory_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", frames(8))
    data = bytearray(path.read_bytes())
    chunk = data.index(b"\x04\x00\x00\x00zstd") - 37
    data[chunk + 9 + 16 : chunk + 9 + 24] = (1 << 50).to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="unpacks to"):
        frames_of(path)


@pytest.mark.parametrize("since", [0, 1, 19, 20, 21, 55, 79, 80])
def test_beginning_later_gives_what_filtering_gives(tmp_path: Path, since: int) -> None:
    sent = frames(80)
    recording = open_recording(write(tmp_path / "a.mcap", sent, chunk=20))
    begin = BEGIN_NS + 700_000 + since * 1_000_000
    assert list(recording.frames(begin)) == [f for f in sent if f.arrival >= begin]


def test_span_and_topics(tmp_path: Path) -> None:
    sent = frames(80)
    recording = open_recording(write(tmp_path / "a.mcap", sent, chunk=20))
    span = recording.span()
    assert span is not None
    assert (span.first, span.last) == (sent[0].arrival, sent[-1].arrival)
    assert span.seconds == pytest.approx(0.079)
    assert recording.topics() == {f.topic for f in sent}


def test_an_empty_recording_is_one_too(tmp_path: Path) -> None:
    recording = open_recording(write(tmp_path / "a.mcap", []))
    assert list(recording.messages()) == []
    assert recording.span() is None
    with pytest.raises(RecordingError, match="no message"):
        recording.require_span()


@pytest.mark.parametrize("content", [b"", b"hello, world", b"\x00" * 50, b"\x89PNG\r\n\x1a\n" + b"\x00" * 50])
def test_what_is_no_recording_is_said_to_be_none(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(RecordingError):
        frames_of(tmp_path / "a")


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"absent\.mcap"):
        open_recording(tmp_path / "absent.mcap")
    with pytest.raises(RecordingError):
        open_recording(tmp_path)


def foreign(path: Path, sent: list[Frame], **options: object) -> Path:
    """The same messages as another tool would write them."""
    buffer = io.BytesIO()
    writer = Writer(buffer, **options)  # type: ignore[arg-type]
    writer.start("other", "another tool")
    channels: dict[bytes, int] = {}
    note = writer.register_channel("notes", "json", 0)
    for frame in sent:
        if frame.topic not in channels:
            channels[frame.topic] = writer.register_channel(frame.topic.decode(), "msgpack", 0)
        writer.add_message(channels[frame.topic], frame.arrival, frame.payload, 0)
        writer.add_message(note, frame.arrival, b'{"left": "out"}', 0)
    writer.finish()  # type: ignore[no-untyped-call]
    path.write_bytes(buffer.getvalue())
    return path


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.NONE},
        {"use_chunking": False},
        {"enable_crcs": False},
        {"use_statistics": False, "repeat_channels": False, "repeat_schemas": False, "use_summary_offsets": False},
    ],
)
def test_files_that_others_wrote_can_be_read(tmp_path: Path, options: dict[str, object]) -> None:
    sent = frames(60)
    recording = open_recording(foreign(tmp_path / "a.mcap", sent, **options))
    assert list(recording.frames()) == sent
    assert list(recording.frames(sent[30].arrival)) == sent[30:]
    assert recording.span() == (sent[0].arrival, sent[-1].arrival)
    assert recording.topics() == {frame.topic for frame in sent}
    assert recording.config_toml is None


def test_a_payload_that_is_no_message_is_an_error_with_its_arrival(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [Frame(77, b"user/imu/left", b"\xc1")])
    with pytest.raises(RecordingError, match="77 ns"):
        list(read(path))
