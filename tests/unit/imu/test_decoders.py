"""What every serial decoder owes: the samples, whatever the split; a way back after garbage; no crash."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imu_streams import DEVICES, RESOLUTION, connected, motion, reconfigured

from foottrack_service import rotations
from foottrack_service.imu.formats import SERIAL_FORMATS

FORMATS = sorted(DEVICES)


@pytest.mark.parametrize("name", FORMATS)
def test_what_the_device_measured_comes_out(name: str) -> None:
    decoder, device = connected(name)
    sent = motion(300, 2500)
    got = [decoder.feed(device.measure(sample)) for sample in sent]
    assert all(len(samples) == 1 for samples in got)
    assert not any(decoder.drops.values())
    acc, gyro, q = RESOLUTION[name]
    for expected, (sample,) in zip(sent, got, strict=True):
        np.testing.assert_allclose(sample.acc, expected.acc, atol=acc)
        assert (sample.gyro is None) == (gyro is None)
        assert (sample.q is None) == (q is None)
        if sample.gyro is not None:
            np.testing.assert_allclose(sample.gyro, expected.gyro, atol=gyro)
        if sample.q is not None:
            assert rotations.angle_between(sample.q, expected.q) < 2 * q
        assert sample.ticks is not None


@pytest.mark.parametrize("name", FORMATS)
@given(data=st.data())
@settings(max_examples=60, deadline=None)
def test_any_split_gives_the_same_samples_and_counts(name: str, data: st.DataObject) -> None:
    whole, device = connected(name)
    split, _ = connected(name)
    stream = b""
    for sample in motion(6, 2500):
        if data.draw(st.booleans()):
            stream += data.draw(st.binary(max_size=300))
        stream += device.measure(sample)
    cuts = sorted(data.draw(st.sets(st.integers(0, len(stream)), max_size=30)))
    expected = whole.feed(stream)
    got = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        got += split.feed(stream[start:end])
    assert got == expected
    assert split.drops == whole.drops


@pytest.mark.parametrize("name", FORMATS)
def test_byte_by_byte(name: str) -> None:
    whole, device = connected(name)
    single, _ = connected(name)
    stream = b"".join(device.measure(sample) for sample in motion(20, 2500))
    samples = [sample for at in range(len(stream)) for sample in single.feed(stream[at : at + 1])]
    assert len(samples) == 20
    assert samples == whole.feed(stream)


@pytest.mark.parametrize("name", FORMATS)
@given(garbage=st.binary(max_size=2000))
@settings(max_examples=100, deadline=None)
def test_after_garbage_at_most_two_messages_are_lost(name: str, garbage: bytes) -> None:
    decoder, device = connected(name)
    for sample in motion(10, 2500):
        decoder.feed(device.measure(sample))
    decoder.feed(garbage)
    # The chip may have been told by the garbage that it started anew: then it is configured again.
    reconfigured_device = name == "bno08x"
    if reconfigured_device:
        reconfigured(decoder, device, now_s=100.0)
    sent = motion(6, 2500, start_us=1_025_000)
    got = [sample for measured in sent for sample in decoder.feed(device.measure(measured))]
    late = got[-3:]
    assert len(got) >= 4
    for expected, sample in zip(sent[-3:], late, strict=True):
        np.testing.assert_allclose(sample.acc, expected.acc, atol=0.01)


@pytest.mark.parametrize("name", FORMATS)
@given(chunks=st.lists(st.binary(max_size=200), max_size=20))
@settings(max_examples=150, deadline=None)
def test_what_comes_out_of_noise_is_finite_and_unit(name: str, chunks: list[bytes]) -> None:
    decoder = SERIAL_FORMATS[name].decoder()
    for chunk in chunks:
        for sample in decoder.feed(chunk):
            numbers = [*sample.acc, *(sample.gyro or ()), *(sample.q or ())]
            assert all(math.isfinite(number) for number in numbers)
            assert sample.q is None or abs(math.hypot(*sample.q) - 1.0) < 1e-9
        decoder.to_send(0.0)


@pytest.mark.parametrize("name", FORMATS)
@given(data=st.data())
@settings(max_examples=100, deadline=None)
def test_a_flipped_bit_costs_a_sample_at_most_and_never_the_next(name: str, data: st.DataObject) -> None:
    decoder, device = connected(name)
    messages = [device.measure(sample) for sample in motion(6, 2500)]
    damaged = bytearray(messages[2])
    position = data.draw(st.integers(0, len(damaged) - 1))
    damaged[position] ^= 1 << data.draw(st.integers(0, 7))
    messages[2] = bytes(damaged)
    samples = [sample for message in messages for sample in decoder.feed(message)]
    truth = motion(6, 2500)
    intact = [
        expected
        for expected in (truth[0], truth[1], truth[4], truth[5])
        if not any(np.allclose(sample.acc, expected.acc, atol=0.01) for sample in samples)
    ]
    assert intact == []


@pytest.mark.parametrize("name", FORMATS)
def test_an_endless_line_does_not_fill_the_memory(name: str) -> None:
    decoder, device = connected(name)
    for _ in range(200):
        decoder.feed(b"A" * 10_000)
    held = sum(len(value) for value in _buffers(decoder))
    assert held < 5000
    messages = motion(4, 2500)
    assert len([s for m in messages for s in decoder.feed(device.measure(m))]) >= 2


def _buffers(decoder: object) -> list[bytes]:
    inner = [decoder, *(value for value in vars(decoder).values() if hasattr(value, "__dict__"))]
    inner += [value for part in inner[1:] for value in vars(part).values() if hasattr(value, "__dict__")]
    return [value for part in inner for value in vars(part).values() if isinstance(value, bytes)]
