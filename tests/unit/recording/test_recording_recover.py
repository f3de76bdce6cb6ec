"""Salvage: all that is whole comes back, nothing that is not, and what was lost is said."""

from __future__ import annotations

import random
from bisect import bisect_right
from pathlib import Path

import pytest
from recording_samples import CONFIG, frames, frames_of, write

from foottrack_service.recording import container
from foottrack_service.recording.bare import to_bare
from foottrack_service.recording.errors import RecordingError
from foottrack_service.recording.reader import Frame, open_recording
from foottrack_service.recording.recover import Recovered, recover

CHUNK = 10
COUNT = 50


def chunk_ends(path: Path) -> list[int]:
    """Offsets where a chunk is complete."""
    with path.open("rb") as stream:
        return [
            record.offset + 9 + len(record.content)
            for record in container.records(stream, path)
            if record.opcode == container.Opcode.CHUNK
        ]


def recovered(tmp_path: Path, data: bytes) -> tuple[Recovered, list[Frame]]:
    path, out = tmp_path / "damaged.mcap", tmp_path / "out.mcap"
    out.unlink(missing_ok=True)
    path.write_bytes(data)
    report = recover(path, out)
    return report, frames_of(out) if out.exists() else []


def test_a_whole_recording_comes_back_as_it_is(tmp_path: Path) -> None:
    sent = frames(COUNT)
    path = write(tmp_path / "a.mcap", sent, CHUNK)
    report = recover(path, tmp_path / "b.mcap")
    assert report.whole
    assert (report.messages, report.lost_messages, report.lost_bytes, report.gaps) == (COUNT, 0, 0, 0)
    assert frames_of(tmp_path / "b.mcap") == sent
    assert open_recording(tmp_path / "b.mcap").config_toml == CONFIG
    assert (report.first, report.last) == (sent[0].arrival, sent[-1].arrival)


def test_cut_anywhere_the_whole_chunks_before_come_back(tmp_path: Path) -> None:
    sent = frames(COUNT)
    whole = write(tmp_path / "a.mcap", sent, CHUNK)
    data, ends = whole.read_bytes(), chunk_ends(whole)
    with whole.open("rb") as stream:
        edges = [record.offset for record in container.records(stream, whole)]
    near = {edge + step for edge in edges for step in (-1, 0, 1, 9)}
    cuts = sorted(near | set(random.Random(2).sample(range(len(data)), 30)))
    for cut in (cut for cut in cuts if 8 <= cut < len(data)):
        report, got = recovered(tmp_path, data[:cut])
        assert got == sent[: CHUNK * bisect_right(ends, cut)], f"cut at {cut}"
        assert not report.whole
        assert report.messages == len(got)


@pytest.mark.parametrize("size", [1, 7, 8, 60])
def test_of_too_little_nothing_comes_back_and_no_file_is_made(tmp_path: Path, size: int) -> None:
    data = write(tmp_path / "a.mcap", frames(4)).read_bytes()
    report, _ = recovered(tmp_path, data[:size])
    assert report.messages == 0
    assert not report.whole
    assert not (tmp_path / "out.mcap").exists()


def test_what_was_never_a_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"hello")
    with pytest.raises(RecordingError):
        recover(tmp_path / "a", tmp_path / "b.mcap")


def test_a_damaged_chunk_costs_that_chunk_and_the_loss_is_counted(tmp_path: Path) -> None:
    sent = frames(COUNT)
    whole = write(tmp_path / "a.mcap", sent, CHUNK)
    data = bytearray(whole.read_bytes())
    data[chunk_ends(whole)[2] - 50] ^= 0x10
    report, got = recovered(tmp_path, bytes(data))
    assert got == sent[:20] + sent[30:]
    assert report.lost_messages == CHUNK
    assert report.gaps == CHUNK
    assert report.lost_bytes > 0
    assert len(report.damage) == 1


def test_a_hit_opcode_or_length_costs_at_most_its_chunk(tmp_path: Path) -> None:
    sent = frames(COUNT)
    whole = write(tmp_path / "a.mcap", sent, CHUNK)
    data = whole.read_bytes()
    begin = data.index(b"\x04\x00\x00\x00zstd", chunk_ends(whole)[1]) - 37
    for byte in range(begin, begin + 9):
        for bit in (0x01, 0x80):
            hit = bytearray(data)
            hit[byte] ^= bit
            report, got = recovered(tmp_path, bytes(hit))
            assert got in (sent, sent[:20] + sent[30:]), f"byte {byte - begin} of the head"
            assert not report.whole
            assert report.lost_messages == COUNT - len(got)


def test_without_its_first_chunk_the_summary_names_the_topics(tmp_path: Path) -> None:
    sent = frames(COUNT)
    whole = write(tmp_path / "a.mcap", sent, CHUNK)
    data = bytearray(whole.read_bytes())
    data[chunk_ends(whole)[0] - 20] ^= 0xFF
    report, got = recovered(tmp_path, bytes(data))
    assert got == sent[CHUNK:]
    assert report.lost_messages == CHUNK


def test_without_first_chunk_and_summary_the_loss_is_said(tmp_path: Path) -> None:
    whole = write(tmp_path / "a.mcap", frames(COUNT), CHUNK)
    ends = chunk_ends(whole)
    data = bytearray(whole.read_bytes()[: ends[3]])
    data[ends[0] - 20] ^= 0xFF
    report, got = recovered(tmp_path, bytes(data))
    assert got == []
    assert any("30 messages are lost" in detail for _, detail in report.damage)


def test_random_holes_never_bring_up_anything_false(tmp_path: Path) -> None:
    sent = frames(COUNT)
    data = write(tmp_path / "a.mcap", sent, CHUNK).read_bytes()
    order = {frame: index for index, frame in enumerate(sent)}
    rng = random.Random(3)
    for _ in range(120):
        hit = bytearray(data)
        for _ in range(rng.randint(1, 3)):
            begin = rng.randrange(8, len(data))
            end = min(len(data), begin + rng.choice((1, 4, 64, 700)))
            hit[begin:end] = rng.choice((bytes(end - begin), rng.randbytes(end - begin)))
        report, got = recovered(tmp_path, bytes(hit))
        places = [order[frame] for frame in got]
        assert places == sorted(set(places))
        assert report.whole == (bytes(hit) == data)
        assert report.messages == len(got)


def test_a_bare_stream_is_salvaged_up_to_where_it_breaks(tmp_path: Path) -> None:
    sent = frames(COUNT)
    packed = [to_bare(frame) for frame in sent]
    data = b"".join(packed)
    report, got = recovered(tmp_path, data[:-10])
    assert got == sent[:-1]
    assert report.lost_bytes == len(packed[-1]) - 10
    assert [offset for offset, _ in report.damage] == [len(data) - len(packed[-1])]


def test_a_bare_message_that_is_none_is_left_out_and_counted(tmp_path: Path) -> None:
    sent = frames(6)
    broken = sent[2]._replace(payload=b"\x81\xa1v\x07")
    report, got = recovered(tmp_path, b"".join(to_bare(f) for f in [*sent[:2], broken, *sent[3:]]))
    assert got == sent[:2] + sent[3:]
    assert report.lost_bytes == len(to_bare(broken))
    assert not report.whole
